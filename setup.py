"""The compiled part of the build, and the cases and pages that are installed with the package; the rest is in
pyproject.toml.

PBEM_MARCH names the processor to build for (as gcc's -march, or -mcpu on other machines than x86), e.g. x86-64-v3.
Unset it is the processor of this machine, or the compiler's default where the compiler does not know how to name that;
empty, the compiler's default.
"""

import glob
import os
import platform

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.sdist import sdist
from setuptools.errors import CompileError

# The parts of -ffast-math that let logarithm and arc tangent be vectorised. NaN and infinity keep their meaning, and
# nothing of it reaches the linker, where -ffast-math would change the arithmetic of the whole process.
# __FAST_MATH__ makes the C library declare its vector functions. With the limited range a complex product is four real
# ones, without the test that tells infinity from NaN: 10 to 20 % of the time of the kernels.
MATH_FLAGS = [
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fassociative-math",
    "-fno-signed-zeros",
    "-freciprocal-math",
    "-fcx-limited-range",
    "-D__FAST_MATH__",
]


def select_processor_flags() -> list[str]:
    """Return the compiler option that names the processor to build for, or none."""
    processor = os.environ.get("PBEM_MARCH", "native")
    if not processor:
        return []
    on_x86 = platform.machine().lower() in ("x86_64", "amd64", "i686")
    return [f"-march={processor}" if on_x86 else f"-mcpu={processor}"]


class BuildKernels(build_ext):
    """Builds for this processor if the compiler can, otherwise for any; a processor that was named is kept."""

    def build_extension(self, ext: Extension) -> None:
        """Build one extension."""
        try:
            super().build_extension(ext)
        except CompileError:
            processor = select_processor_flags()
            if not processor or "PBEM_MARCH" in os.environ:
                raise
            print(f"the compiler refused {processor[0]}: once more without it; the kernels will be slower")
            ext.extra_compile_args = [flag for flag in ext.extra_compile_args if flag not in processor]
            super().build_extension(ext)


class CompleteSource(sdist):
    """A source package with the kernels' headers, which setuptools takes no notice of."""

    def make_distribution(self) -> None:
        """Pack all files."""
        self.filelist.extend(sorted(glob.glob("pbem/bem/*.h")))
        super().make_distribution()


setup(
    cmdclass={"build_ext": BuildKernels, "sdist": CompleteSource},
    packages=[*find_packages(include=["pbem", "pbem.*"]), "pbem.cases", "pbem.cases.gallery"],
    package_dir={"pbem.cases": "cases", "pbem.cases.gallery": "cases/gallery"},
    package_data={"pbem.bem": ["*.pyi"], "pbem.cases": ["*.toml", "networks/*"], "pbem.cases.gallery": ["*.toml"],
                  "pbem.pages": ["*.md"]},
    ext_modules=[
        Extension(
            f"pbem.bem.{name}",
            sources=[f"pbem/bem/{name}.c"],
            depends=sorted(glob.glob("pbem/bem/*.h")),
            extra_compile_args=["-O3", *select_processor_flags(), *MATH_FLAGS],
            libraries=["m"],
        )
        for name in ("_kernels", "_expansions")
    ],
)
