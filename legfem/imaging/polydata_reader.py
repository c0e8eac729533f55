"""A surface in VTK's polydata (``.vtp``, legacy ``.vtk``), read by VTK itself in a process of its own.

A broken file ends VTK's readers with a signal, or keeps them for ever: that may only cost their own process. See
Kitware, VTK File Formats (docs.vtk.org/en/latest/vtk_file_formats).
"""

import importlib.util
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

_LONGEST_S = 60
_MEMORY = 4 << 30
_TO_LPS = np.array([-1.0, -1.0, 1.0])


def read_polydata(path: Path) -> tuple[Any, Any]:
    """Read points (n, 3), mm, and triangles (m, 3) of a surface; polygons and strips are cut into triangles.

    Slicer's ``SPACE=RAS`` in a legacy file's title is brought to the patient's left and back.

    Raises
    ------
    ValueError
        If the file isn't what it says.
    ModuleNotFoundError
        If VTK isn't installed.
    """
    if importlib.util.find_spec("vtk") is None:
        raise ModuleNotFoundError("No module named 'vtk'", name="vtk")
    command = [sys.executable, "-m", __name__, str(path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"VTK hasn't read it within {_LONGEST_S} s") from None
    if done.returncode < 0:
        raise ValueError("VTK's reader breaks down on it")
    if done.returncode:
        raise ValueError(done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2])
    found = np.load(BytesIO(done.stdout))
    return found["points"], found["triangles"]


def _read(path: str) -> tuple[Any, Any]:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter
    from vtkmodules.vtkIOLegacy import vtkPolyDataReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    legacy = not path.lower().endswith(".vtp")
    reader = vtkPolyDataReader() if legacy else vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    found, said = reader.GetOutput(), window.GetOutput()
    if said or reader.GetErrorCode():
        sys.exit(said.partition("): ")[2].partition("\n")[0] or "VTK can't read it")
    if not found.GetNumberOfPoints():
        sys.exit("it contains no points")
    points = vtk_to_numpy(found.GetPoints().GetData())
    # VTK's filters trust what the cells say.
    for cells in (found.GetPolys(), found.GetStrips()):
        nodes, ends = map(vtk_to_numpy, (cells.GetConnectivityArray(), cells.GetOffsetsArray()))
        if (np.diff(ends) < 0).any() or ends[0] != 0 or ends[-1] != len(nodes):
            sys.exit("a polygon ends where there are no points")
        if len(nodes) and not (0 <= nodes.min() and nodes.max() < len(points)):
            sys.exit("a polygon names a point that isn't there")
    triangles = vtkTriangleFilter(pass_verts=False, pass_lines=False)
    triangles.SetInputData(found)
    triangles.Update()
    faces = vtk_to_numpy(triangles.GetOutput().GetPolys().GetConnectivityArray()).reshape(-1, 3)
    ras = legacy and "SPACE=RAS" in reader.GetHeader()
    return points * _TO_LPS if ras else points, faces


if __name__ == "__main__":
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    points, triangles = _read(sys.argv[1])
    np.savez(sys.stdout.buffer, points=points, triangles=triangles)
