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
)
# Single commands need these; a distribution may lack them.
optional_packages=(python3-ezdxf python3-pandas)
# Of these the ones of the distribution stay, whatever else is installed into .venv: wheels bring another MPI and HDF5.
kept_packages=(numpy h5py mpi4py petsc4py)
# What the distributions lack or have too old.
python_packages=("pydantic>=2.5" "tqdm>=4.64" "ruff>=0.4" "mypy>=1.8")

say() { printf 'setup: %s\n' "$*" >&2; }
fail() {
    say "$@"
    exit 1
}

# What a package is for, where it is left out.
name_use() {
    case $1 in
        python3-ezdxf) echo "pbem import of .dxf files" ;;
        *) echo "to_dataframe, and some tests" ;;
    esac
}

is_offered() { [ -n "$(apt-cache show --no-all-versions "$1" 2>/dev/null)" ]; }

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
    if [ "$(id -u)" -ne 0 ] && command -v sudo >/dev/null; then as_root=(sudo); fi
    if [ ${#missing[@]} -gt 0 ]; then
        [ "$(id -u)" -eq 0 ] || [ ${#as_root[@]} -gt 0 ] || fail "as root, first run: apt-get install ${missing[*]}"
        say "installing ${missing[*]}"
        "${as_root[@]}" apt-get update -q
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
    fi
    for package in "${optional_packages[@]}"; do
        is_installed "$package" || install_optional_package "$package" "${as_root[@]}"
    done
}

# Without it the rest works: it is never a reason to fail, and nothing is downloaded to find out whether it exists.
install_optional_package() {
    local package=$1 reason="this distribution has none"
    shift
    if is_offered "$package"; then
        "$@" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "$package" && return
        reason="apt-get could not install it"
    fi
    say "$package is left out, $reason; needed for $(name_use "$package"): .venv/bin/pip install ${package#python3-}"
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
    [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint)" ] && compgen -G "$root/pbem/bem/_kernels*.so" >/dev/null &&
        [ -f "$venv/pip.conf" ] && [ -z "$(list_strangers)" ] && is_importable 2>/dev/null
}

# Everything that a run imports; what is wrong is told on standard error.
is_importable() {
    (cd / && "$venv/bin/python" -c 'import pydantic, tqdm, scipy, matplotlib, h5py, pbem.bem._kernels, pbem.bem._expansions, pbem.cli')
}

# Packages that are found elsewhere than in the distribution: those in .venv hide its own.
list_strangers() {
    (
        cd / && "$venv/bin/python" - /usr/lib/ "${kept_packages[@]}" 2>/dev/null <<'END'
import importlib.util, sys

for name in sys.argv[2:]:
    found = importlib.util.find_spec(name)
    if found is None or not str(found.origin).startswith(sys.argv[1]):
        print(name)
END
    )
}

remove_strangers() {
    local name
    for name in $(list_strangers); do
        say "removing $name from .venv, where it hides the one of the distribution"
        "$venv/bin/python" -m pip uninstall -q -y --disable-pip-version-check "$name" || true
    done
    refuse_strangers
}

# What pip does not know of it cannot remove.
refuse_strangers() {
    local strangers
    strangers=$(list_strangers)
    [ -z "$strangers" ] || fail "expected in /usr/lib, but found elsewhere:" $strangers "- remove .venv, then run this again"
}

# From now on pip keeps these versions. Debian's h5py goes by another name there: pip is told that h5py is installed.
pin_packages() {
    (
        cd / && "$venv/bin/python" - "$venv" "${kept_packages[@]}" <<'END'
import importlib, pathlib, shutil, sys, sysconfig

venv, names = pathlib.Path(sys.argv[1]), sys.argv[2:]
versions = {name: importlib.import_module(name).__version__ for name in names}
constraints = venv / "constraints.txt"
constraints.write_text("".join(f"{name}=={version}\n" for name, version in versions.items()))
(venv / "pip.conf").write_text(f"[install]\nconstraint = {constraints.as_uri()}\n")
site = pathlib.Path(sysconfig.get_path("purelib"))
for old in site.glob("h5py-*.dist-info"):
    shutil.rmtree(old)
if not any(pathlib.Path("/usr/lib/python3/dist-packages").glob("h5py-*")):
    told = site / f"h5py-{versions['h5py']}.dist-info"
    told.mkdir()
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: h5py\nVersion: {versions['h5py']}\n")
    (told / "INSTALLER").write_text("pbem\n")
    (told / "RECORD").write_text("".join(f"{told.name}/{name},,\n" for name in ("METADATA", "INSTALLER", "RECORD")))
END
    ) || fail "pip could not be told to keep ${kept_packages[*]} as they are"
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

# Python reads what is compiled where it may not write it (PYTHONDONTWRITEBYTECODE, or a checkout of another user), and
# otherwise compiles hundreds of modules at each start: a third of a small run.
compile_modules() { "$venv/bin/python" -m compileall -qq "$root/pbem" || say "modules are compiled at each start"; }

# The kept packages must be the ones of the distribution: others are built with another MPI.
check_origin() {
    refuse_strangers
    is_importable || fail "the environment is not usable, see above; remove .venv, then run this again"
}

main() {
    export PIP_USER=0
    unset PYTHONHOME PYTHONPATH
    exec 9<"$root" && flock 9 # one set-up of this checkout at a time
    install_system_packages
    if is_up_to_date; then
        compile_modules
        return
    fi
    say "building $venv"
    make_venv
    rm -f "$stamp"
    remove_strangers
    pin_packages
    install_python_packages
    check_origin
    compile_modules
    fingerprint >"$stamp"
    say "done: $venv/bin/pbem"
}

main
