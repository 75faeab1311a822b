#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares volume, area, centre of mass and inertia of wrenchd-import with those of FreeCAD, for the same STEP files.

Usage: check_freecad.py PROGRAM [FILE.step...]: the built wrenchd-import; without files FreeCAD makes some. Exit code 77: FreeCAD is
not installed.
"""
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.append("/usr/lib/freecad-python3/lib")
try:
    import FreeCAD
    import Part
except ImportError:
    print("skipped: no FreeCAD; install freecad-python3")
    sys.exit(77)

MOST = 1e-8  # relative; the report has nine digits


def samples(directory):
    """Writes STEP files with FreeCAD."""
    vector = FreeCAD.Vector
    plate = Part.makeBox(60, 40, 10).cut(Part.makeCylinder(8, 20, vector(30, 20, -5)))
    box = Part.makeBox(40, 30, 20)
    tilted = Part.makeTorus(30, 8)
    tilted.Placement = FreeCAD.Placement(vector(5, -7, 11), FreeCAD.Rotation(vector(1, 2, 3), 40))
    pipe = Part.makeCylinder(12, 50).cut(Part.makeCylinder(9, 50)).cut(Part.makeCylinder(4, 40, vector(-20, 0, 25), vector(1, 0, 0)))
    outline = [vector(0, 0, 0), vector(30, 0, 5), vector(35, 0, 20), vector(10, 0, 35), vector(0, 0, 30)]
    spline = Part.BSplineCurve()
    spline.interpolate(outline)
    profile = Part.Wire([spline.toShape(), Part.makeLine(outline[-1], outline[0])])
    shapes = {
        "plate": plate,
        "filleted": box.makeFillet(4, box.Edges),
        "torus": tilted,
        "pipe": pipe,
        "turned": Part.makeSolid(Part.Shell(Part.Face(profile).revolve(vector(0, 0, 0), vector(0, 0, 1), 360).Faces)),
        "assembly": Part.makeCompound([plate, Part.makeCylinder(3, 20, vector(10, 20, 30)), Part.makeSphere(7, vector(50, 20, 40))]),
    }
    for name, shape in shapes.items():
        shape.exportStep(str(directory / f"{name}.step"))
        yield directory / f"{name}.step"


def imported(program, file):
    """Returns the exact and the mesh's numbers of the report by their label."""
    asked = subprocess.run([program, file, "--chord", "0.02mm"], capture_output=True, text=True, check=False)
    if asked.returncode != 0:
        raise RuntimeError(asked.stderr.strip())
    found = re.findall(r"^(volume|area|centre of mass .|inertia ..) +(\S+) (\S+) \S+ ", asked.stdout, re.M)
    return {label: (float(exact), float(mesh)) for label, exact, mesh in found}, asked.stdout


def freecad(file):
    """Returns FreeCAD's numbers in the same units, metres and kilograms."""
    shape = Part.Shape()
    shape.read(str(file))
    solids = shape.Solids
    volume = sum(s.Volume for s in solids)
    centre = sum((s.CenterOfMass * s.Volume for s in solids), FreeCAD.Vector()) * (1 / volume)
    numbers = {"volume": volume * 1e-9, "area": sum(s.Area for s in solids) * 1e-6}
    inertia = [[0.0] * 3 for _ in range(3)]
    for solid in solids:  # about the common centre
        d = solid.CenterOfMass - centre
        m = solid.MatrixOfInertia
        own = [[m.A11, m.A12, m.A13], [m.A21, m.A22, m.A23], [m.A31, m.A32, m.A33]]
        for i in range(3):
            for j in range(3):
                shift = (d.Length**2 if i == j else 0.0) - d[i] * d[j]
                inertia[i][j] += own[i][j] + solid.Volume * shift
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        numbers[f"inertia {'xyz'[i]}{'xyz'[j]}"] = inertia[i][j] / volume * 1e-6
    for i in range(3):
        numbers[f"centre of mass {'xyz'[i]}"] = centre[i] * 1e-3
    return numbers, shape.BoundBox.DiagonalLength * 1e-3


def main():
    program, files = sys.argv[1], sys.argv[2:]
    worst = 0.0
    with tempfile.TemporaryDirectory() as directory:
        for file in files or list(samples(Path(directory))):
            ours, report = imported(program, file)
            if "volume" not in ours:
                print(f"{Path(file).name}: its solids overlap; not compared")
                continue
            theirs, size_m = freecad(file)
            chord = re.search(r"^chord error +(.*)$", report, re.M)[1]
            for label, expected in theirs.items():
                exact, _ = ours[label]
                scale = size_m if "centre" in label else theirs["inertia xx"] if "inertia" in label else expected
                if not math.isfinite(exact):
                    sys.exit(f"{file}: {label} is {exact}")
                worst = max(worst, abs(exact - expected) / abs(scale))
                if abs(exact - expected) > MOST * abs(scale):
                    sys.exit(f"{Path(file).name}: {label}: {exact} here, {expected} in FreeCAD")
            exact, mesh = ours["volume"]
            print(f"{Path(file).name}: volume {exact:.9g} m^3, FreeCAD {theirs['volume']:.9g} m^3, mesh {mesh / exact - 1:+.1e}; "
                  f"chord error {chord}")
    print(f"largest relative difference from FreeCAD {FreeCAD.Version()[0]}.{FreeCAD.Version()[1]}: {worst:.1e}")


main()
