"""The compiled loops: the inner loops of a hop. pyproject.toml has the rest of the build."""

from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext


class BuildLoops(build_ext):
    """Compiles the loops in each build: loops of an earlier one never stand in for loops that cannot be compiled."""

    def build_extension(self, ext: Extension) -> None:
        """Compile one module."""
        in_place = Path("library", "compiled").glob("_loops.*.so") if self.editable_mode or self.inplace else ()
        for stale in (Path(self.get_ext_fullpath(ext.name)), *in_place):
            stale.unlink(missing_ok=True)
        self.force = True
        super().build_extension(ext)


LOOPS = Extension(
    "kinespace.library.compiled._loops",
    sources=["library/compiled/loops.c"],
    # Python itself asks for -fwrapv, with which gcc makes some of these loops slower, and for -g, which writes the
    # folder's name into the wheel: a wheel that is built twice is to be the same, byte for byte.
    extra_compile_args=["-O3", "-g0", "-ffp-contract=fast", "-fno-math-errno", "-fno-wrapv", "-Wno-psabi"],
    # sqrt: found without it only where Python itself has been linked with it.
    libraries=["m"],
    py_limited_api=True,
    # Where there is no compiler they are left out, and numpy does the same, more slowly.
    optional=True,
)
# One wheel for every Python from 3.11 on.
setup(ext_modules=[LOOPS], cmdclass={"build_ext": BuildLoops}, options={"bdist_wheel": {"py_limited_api": "cp311"}})
