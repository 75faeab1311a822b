# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the compiled engine with CMake from the source tree that this folder is part of."""

import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = Path(__file__).resolve().parent.parent.parent


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        if not (SOURCE / "collision" / "CMakeLists.txt").exists():
            raise SystemExit(f"wrenchd: {SOURCE} is not wrenchd's source tree; run 'pip install ./tools/python' in a clone of it")
        if shutil.which("cmake") is None:
            raise SystemExit("wrenchd: cmake is missing; tools/setup installs it with everything else that the engine needs")
        build = Path(self.build_temp).resolve()
        build.mkdir(parents=True, exist_ok=True)
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        subprocess.run(["cmake", "-S", SOURCE, "-B", build, *generator, "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
                        "-DWRENCHD_ENGINE_ONLY=ON", "-DBUILD_TESTING=OFF", "-DCMAKE_MODULE_LINKER_FLAGS=-s",
                        f"-DPython3_EXECUTABLE={sys.executable}"], check=True)
        subprocess.run(["cmake", "--build", build, "--parallel", "--target", "wrenchd_engine"], check=True)
        built = next((build / "python" / "wrenchd").glob("_engine.*.so"))
        target = Path(self.get_ext_fullpath(ext.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(built, target)


setup(ext_modules=[Extension("wrenchd._engine", [])], cmdclass={"build_ext": CMakeBuild})
