#!/usr/bin/env bash
# Makes the checkout ready to run on Debian 12, 13 or Ubuntu 24.04: system packages, .venv, the compiled kernels.
# Run it again at any time: what is there is left alone, and then no network is needed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
venv=$root/.venv
stamp=$venv/pbem-setup-stamp

# The MPI, PETSc and HDF5 of the distribution fit each other, with mpi4py, petsc4py and h5py built against them.
system_packages=(
    gcc libc6-dev python3-dev python3-venv python3-pip python3-setuptools python3-wheel
    python3-numpy python3-scipy python3-matplotlib python3-pytest python3-pytest-xdist
    python3-mpi4py python3-petsc4py libpetsc-real-dev python3-h5py python3-h5py-mpi openmpi-bin libopenblas0-pthread
    python3-meshio python3-ezdxf
)
# What the distributions lack or have too old.
python_packages=("pydantic>=2.5" "tqdm>=4.64" "ruff>=0.4" "mypy>=1.8")

say() { printf 'setup: %s\n' "$*" >&2; }
fail() {
    say "$@"
    exit 1
}

is_installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

install_system_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
        fail "this script knows Debian 12, 13 and Ubuntu 24.04 (apt-get). Elsewhere pbem needs Python >= 3.11, a C" \
            "compiler, MPI, PETSc >= 3.18 with MUMPS and ScaLAPACK, petsc4py, mpi4py, h5py, numpy, scipy, matplotlib," \
            "pydantic and tqdm; pbem/pages/install.md says how else to install them."
    fi
    local missing=() package as_root=()
    for package in "${system_packages[@]}"; do
        is_installed "$package" || missing+=("$package")
    done
    [ ${#missing[@]} -eq 0 ] && return
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail "as root, first run: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    say "installing ${missing[*]}"
    "${as_root[@]}" apt-get update -q
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
}

# Everything that decides how the environment and the kernels are built; the processor too, as they are built for it.
fingerprint() {
    {
        echo "$root ${PBEM_MARCH-native}"
        /usr/bin/python3 --version
        uname -m
        grep -m 1 -E '^(flags|Features)' /proc/cpuinfo || true
        cat "$root/pyproject.toml" "$root/setup.py" "$root/scripts/setup.sh"
        find "$root/pbem" -name '*.[ch]' -print0 | LC_ALL=C sort -z | xargs -0 cat
    } | sha256sum
}

is_up_to_date() {
    [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint)" ] && compgen -G "$root/pbem/bem/_kernels*.so" >/dev/null
}

# An environment that was made by another Python, sees no system packages or has been moved here cannot be mended.
is_sound_venv() {
    [ -x "$venv/bin/pip" ] &&
        [ "$("$venv/bin/python" -c 'import sys; print(*sys.version_info[:2], sys.base_prefix)' 2>/dev/null)" \
            = "$(/usr/bin/python3 -c 'import sys; print(*sys.version_info[:2], sys.base_prefix)')" ] &&
        grep -q 'include-system-site-packages = true' "$venv/pyvenv.cfg" &&
        grep -qF "$venv/bin/" "$venv/bin/pip"
}

make_venv() {
    is_sound_venv && return
    [ -d "$venv" ] && say "making .venv anew: the one here is of another Python or another place"
    /usr/bin/python3 -m venv --clear --system-site-packages "$venv"
}

install_python_packages() {
    # Not --upgrade: what is there and new enough stays. numpy and h5py are none of these packages' needs.
    PYTHONNOUSERSITE=1 "$venv/bin/python" -m pip install -q --disable-pip-version-check "${python_packages[@]}" ||
        fail "pip could not install ${python_packages[*]}; is there a network?"
    # --no-deps: pip does not see the h5py of Debian and would lay a wheel with another HDF5 over it.
    (cd "$root" && PYTHONNOUSERSITE=1 "$venv/bin/python" -m pip install -q --disable-pip-version-check \
        --no-deps --no-build-isolation -e .) || fail "pbem or its C extension could not be built"
}

# The libraries below must be the ones of the distribution: others are built with another MPI.
check_origin() {
    (cd / && "$venv/bin/python" - /usr/lib/ <<'END') || fail "the environment is not usable; see the line above"
import importlib.util, sys

wrong = []
for name in ("numpy", "mpi4py", "petsc4py", "h5py"):
    found = importlib.util.find_spec(name)
    if found is None or not str(found.origin).startswith(sys.argv[1]):
        wrong.append(f"{name} at {found and found.origin}")
if wrong:
    sys.exit(f"setup: expected in {sys.argv[1]}, but found {', '.join(wrong)}: uninstall it there (pip uninstall)")
import pbem.bem._kernels
END
}

main() {
    export PIP_USER=0
    unset PYTHONHOME PYTHONPATH
    exec 9<"$root" && flock 9 # one set-up of this checkout at a time
    install_system_packages
    is_up_to_date && return
    say "building $venv"
    make_venv
    rm -f "$stamp"
    install_python_packages
    check_origin
    fingerprint >"$stamp"
    say "done: $venv/bin/pbem"
}

main
