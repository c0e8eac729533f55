"""What a camera or a film saw, in the layouts in which their programs export it."""

from __future__ import annotations

import io
from collections.abc import Iterable

import h5py
import numpy as np
from scipy.io import savemat

TIMES = np.arange(0.0, 6.0)
"""s: a frame a second of a pull at 0.1 mm/s."""
PIXEL = 0.05
MIDDLE = np.array([256.0, 200.0])
"""mm a pixel, and where the face's middle is in the camera's image, whose y points down."""
X, Y = (one.ravel() for one in np.meshgrid(np.arange(-3.2, 3.4, 0.8), np.arange(-4.9, 4.8, 0.8)))
"""Points on a face of 10 mm by 10 mm, mm."""
PLACES = np.column_stack([X, Y])


def moved(time: float) -> np.ndarray:
    """Return how far the points have moved, mm: stretched along, narrower in the middle, and lifted as a whole."""
    share = 0.1 * time / 10.0
    across = -0.45 * share * X * (1 - 0.3 * (Y / 5) ** 2)
    return np.column_stack([across + 0.01 * time, share * Y + 0.05 * time])


FRAMES = [moved(time) for time in TIMES]


def own(frames: Iterable[int] = range(len(TIMES)), lost: Iterable[int] = ()) -> str:
    """Return legfem's own table of some frames, without points that were lost in each."""
    kept = [k for k in range(len(X)) if k not in set(lost)]
    rows = [
        f"{TIMES[f]:g},{X[k]:.9f},{Y[k]:.9f},{FRAMES[f][k, 0]:.9f},{FRAMES[f][k, 1]:.9f}" for f in frames for k in kept
    ]
    return "\n".join(["time_s,x_mm,y_mm,ux_mm,uy_mm", *rows]) + "\n"


def table(columns: dict[str, np.ndarray], delimiter: str = ",", comma: bool = False, lost: Iterable[int] = ()) -> str:
    """Return a header and rows; points that were lost have NaN wherever they have moved."""
    lines = [delimiter.join(columns)]
    gone, last = set(lost), list(columns)[-2:]
    for k in range(len(next(iter(columns.values())))):
        cells = ["NaN" if k in gone and name in last else f"{one[k]:.9f}" for name, one in columns.items()]
        lines.append(delimiter.join(cells).replace(".", ",") if comma else delimiter.join(cells))
    return "\n".join(lines) + "\n"


def columns(f: int, names: Iterable[str], unit: float = 1.0, went: bool = False) -> dict[str, np.ndarray]:
    """Return the points of a frame under names of x, y, ux, uy, over a unit in mm; where they went, if asked."""
    place = PLACES + (FRAMES[f] if went else 0.0)
    return dict(zip(names, np.hstack([place, FRAMES[f]]).T / unit, strict=True))


def pixels(f: int, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return the points of a frame in the camera's pixels, y down."""
    down = np.array([1.0, -1.0])
    return dict(zip(names, np.hstack([MIDDLE + PLACES * down / PIXEL, FRAMES[f] * down / PIXEL]).T, strict=True))


def matrices() -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Return Ncorr's matrices of a frame each from the second on, mm, with 0 beside the face; its middle in pixels."""
    u, v = [], []
    shape = (13 + 4, 9 + 6)
    for frame in FRAMES[1:]:
        both = np.zeros((2, *shape))
        both[:, 2:-2, 3:-3] = frame.T.reshape(2, 13, 9)[:, ::-1]
        u.append(both[0])
        v.append(-both[1])
    # A point every 16 pixels, counted from 1; the first row within the face is at y = 4.7 mm.
    return u, v, np.array([(3 + 4) * 16 + 1.0, (2 + 4.7 / 0.8) * 16 + 1.0])


def ncorr(units: str = "mm", scale: float = PIXEL) -> bytes:
    """Return Ncorr's .mat of version 5."""
    u, v, _ = matrices()
    shown = np.zeros(len(u), dtype=[("plot_u_ref_formatted", "O"), ("plot_v_ref_formatted", "O")])
    for k in range(len(u)):
        shown[k] = (u[k] * scale / PIXEL, v[k] * scale / PIXEL)
    info = {"spacing": 15.0, "pixtounits": scale, "units": units}
    written = io.BytesIO()
    savemat(written, {"data_dic_save": {"displacements": shown, "dispinfo": info}})
    return written.getvalue()


def ncorr_hdf5() -> bytes:
    """Return Ncorr's .mat as Ncorr saves it, of version 7.3."""
    u, v, _ = matrices()
    written = io.BytesIO()
    with h5py.File(written, "w", userblock_size=512) as file:

        def kept(group: h5py.Group, name: str, values: object, kind: str) -> h5py.Dataset:
            made = group.create_dataset(name, data=values)
            made.attrs["MATLAB_class"] = np.bytes_(kind)
            return made

        group = file.create_group("data_dic_save")
        shown, info, refs = (
            group.create_group("displacements"),
            group.create_group("dispinfo"),
            file.create_group("#refs#"),
        )
        for one in (group, shown, info):
            one.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, matrix in (("plot_u_ref_formatted", u), ("plot_v_ref_formatted", v)):
            found = [kept(refs, f"{name}{k}", one.T, "double").ref for k, one in enumerate(matrix)]
            shown.create_dataset(name, data=np.array(found, dtype=h5py.ref_dtype).reshape(-1, 1))
        regions = [kept(refs, f"roi{k}", np.full((6, 1), k, dtype="u4"), "ncorr_class_roi") for k in range(len(u))]
        for one in regions:
            one.attrs["MATLAB_object_decode"] = 3
        found = np.array([one.ref for one in regions], dtype=h5py.ref_dtype)
        shown.create_dataset("roi_ref_formatted", data=found.reshape(-1, 1))
        kept(info, "spacing", [[15.0]], "double")
        kept(info, "pixtounits", [[PIXEL]], "double")
        kept(info, "units", np.array([[ord(one)] for one in "mm"], dtype="u2"), "char").attrs["MATLAB_int_decode"] = 2
    raw = bytearray(written.getvalue())
    raw[:128] = b"MATLAB 7.3 MAT-file".ljust(116) + b" " * 8 + b"\x00\x02IM"
    return bytes(raw)


def multidic() -> bytes:
    """Return MultiDIC's .mat: where points went, in mm, the camera's z among them."""
    points = np.empty(len(FRAMES), object)
    for f, frame in enumerate(FRAMES):
        points[f] = np.column_stack([PLACES + frame, np.full(len(X), 300.0)])
    written = io.BytesIO()
    savemat(written, {"DIC3DPPresults": {"Points3D": points}})
    return written.getvalue()


ACROSS = np.array([0.0, 0.0, 2.0, 9.0, 17.0, 21.0, 18.5, 8.0, 1.5, 0.0, 0.0])
"""kPa in eleven columns of sensels, 2 mm from one to the next, at the end of a press."""
ALONG = np.array([0.8, 1.1, 1.2, 1.05, 0.85])
"""What each of five rows reads over the mean of all."""
PITCH, DEEPEST = 2.0, 6.5
"""mm; the column, counted from 1, at the face's deepest point."""


def grid(f: int) -> np.ndarray:
    """Return what the sensels read in a frame, (rows, columns), kPa."""
    return f / (len(TIMES) - 1) * ALONG[:, None] * ACROSS


def own_film(radius: float, frames: Iterable[int] = range(len(TIMES)), sign: float = 1.0) -> str:
    """Return legfem's own table of the film."""
    angle = sign * np.rad2deg((np.arange(1, 12) - DEEPEST) * PITCH / radius)
    rows = [f"{TIMES[f]:g},{a:.9f},{p:.9f}" for f in frames for a, p in zip(angle, grid(f).mean(axis=0), strict=True)]
    return "\n".join(["time_s,angle_deg,pressure_kPa", *rows]) + "\n"


def rows_of(values: np.ndarray, delimiter: str = ",", comma: bool = False) -> str:
    """Return the rows of a grid."""
    lines = [delimiter.join(f"{one:.6g}" if one % 1 else f"{one:.1f}" for one in row) for row in values]
    return "\n".join(line.replace(".", ",") if comma else line for line in lines) + "\n"
