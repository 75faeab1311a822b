# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the tutorials of tools/python/tutorials. Each checks its own results; this checks that each writes its picture.

Usage: check_tutorials.py DIRECTORY_OF_PROGRAMS WORK_DIRECTORY. Exit code 77: a package of Debian is missing.
"""
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
TUTORIALS = SOURCE / "tools/python/tutorials"


def run(command, work):
    print("$", *command, flush=True)
    subprocess.run(command, cwd=work, check=True, timeout=240)


def main():
    missing = [name for name in ("matplotlib", "pandas", "h5py") if importlib.util.find_spec(name) is None]
    if missing:
        print("skipped: no", *(f"python3-{name}" for name in missing))
        return 77
    work = Path(sys.argv[2])
    work.mkdir(parents=True, exist_ok=True)
    for old in work.glob("*"):
        old.unlink()
    os.environ["PATH"] = sys.argv[1] + os.pathsep + os.environ["PATH"]
    config = str(SOURCE / "config/wrenchd.toml")
    run(["wrenchd", "--config", config, "--virtual-time", "--seconds", "4", "--arm", "--record", "run.h5"], work)
    arguments = {"stable_stiffness": [config], "recording_in_pandas": ["run.h5"]}
    names = sorted(file.stem for file in TUTORIALS.glob("*.py"))
    assert len(names) >= 4, names
    for name in names:
        run([sys.executable, "-W", "error", TUTORIALS / f"{name}.py", *arguments.get(name, [])], work)
        picture = work / f"{name}.svg"
        if "savefig" in (TUTORIALS / f"{name}.py").read_text(encoding="utf-8"):
            assert picture.stat().st_size > 5000, picture
    run([sys.executable, TUTORIALS / "two_meshes.py", SOURCE / "config/meshes/cube.off", SOURCE / "config/meshes/cube.off", "0.001"], work)
    print(len(names), "tutorials")
    return 0


sys.exit(main())
