"""Compiled forms and expressions, kept on disk for the next run.

FFCx compiles C code into a cache. A compilation that is killed leaves a file there at which every
later one waits, and gives up. Here every form has a folder of its own in the cache, and whoever
compiles holds a lock on it, which the system releases when a process dies: what is found unfinished
under the lock is a dead process', and is removed; so is what isn't as it was compiled, by a digest that lies beside it.
"""

import errno
import fcntl
import hashlib
import logging
import os
import platform
import shutil
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import ffcx.naming
import numpy as np
from cffi import VerificationError  # type: ignore[import-untyped]
from dolfinx import default_scalar_type, fem, jit
from mpi4py import MPI
from ufl.algorithms import expand_derivatives
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction
from ufl.domain import extract_unique_domain

from legfem.common.documents import Contents, write_atomically
from legfem.common.errors import naming
from legfem.common.units import FloatArray
from legfem.jobs.store import key_of

FLAGS = ("-O3", "-march=native", "-ffast-math", "-fno-finite-math-only")
"""For gcc. ``-O1`` makes solves longer by about a twelfth, and compiles no faster."""
_LOCK, _SEAL = "lock", "seal"
_LEAST_FREE = 2_000_000
"""Bytes that a form takes at most, sources and all."""
_log = logging.getLogger("legfem")


def compiled(form: Any) -> Any:
    """Return a compiled form; collective over its mesh's ranks."""
    return fem.form(form, jit_options=_compile(form, form.ufl_domain()))


def expression(value: Any, points: FloatArray) -> Any:
    """Return a compiled expression at points of the reference cell; collective likewise."""
    # The labels of variables count on through a process, and would make every signature new.
    value = map_expr_dag(_WithoutVariables(), expand_derivatives(value))
    what = (value, np.asarray(points))
    return fem.Expression(*what, jit_options=_compile(what, extract_unique_domain(value)))


class _WithoutVariables(MultiFunction):
    """UFL's `strip_variables`, which visits what stands in many places once for each of them."""

    expr = MultiFunction.reuse_if_untouched

    def variable(self, o: Any, operand: Any, label: Any) -> Any:
        return operand


def cache_folder() -> Path:
    """Return the folder of what is compiled for this kind of processor.

    Code for another one may not run here, and clusters share home folders.
    """
    return Path(jit.get_options()["cache_dir"]) / f"legfem-{_processor()}"


def _compile(what: Any, domain: Any) -> dict[str, Any]:
    """Compile a UFL object if that wasn't done before; return the options to find it with."""
    tag = ";".join((*FLAGS, str(default_scalar_type), str(sysconfig.get_config_var("SOABI"))))
    options = {
        "cache_dir": cache_folder() / ffcx.naming.compute_signature([what], tag),
        "cffi_extra_compile_args": list(FLAGS),
    }
    # First on rank 0, then on the others.
    jit.mpi_jit_decorator(_compile_here)(domain.ufl_cargo().comm, what, options)
    return options


def _compile_here(what: Any, options: dict[str, Any]) -> None:
    folder = options["cache_dir"]
    folder.mkdir(parents=True, exist_ok=True)
    with _locked(folder) as locked:
        sealed = folder / _SEAL
        if sealed.is_file() and sealed.read_bytes() == _digest(folder):
            return  # all that FFCx began is complete, and nothing has changed since
        _announce()
        if locked:
            for file in folder.iterdir():
                if file.name != _LOCK:
                    file.unlink()
        try:
            with naming(folder):
                jit.ffcx_jit(
                    MPI.COMM_SELF,
                    what,
                    form_compiler_options={"scalar_type": default_scalar_type},
                    # FFCx itself waits for another process only where nothing can be locked.
                    jit_options={**options, "timeout": 10 if locked else 300},
                )
            write_atomically(sealed, _digest(folder))
        except VerificationError as error:
            if shutil.disk_usage(folder).free < _LEAST_FREE:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder)) from error
            what = "the C compiler failed on a form (is gcc there?)"
            raise OSError(errno.ENOEXEC, what, str(folder)) from error


def _digest(folder: Path) -> bytes:
    return key_of([one for one in Contents(folder).digest() if one[0].startswith("lib")]).encode()


@contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Hold the folder's lock, once others have released it; tells whether it is held."""
    with (folder / _LOCK).open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:  # a file system without locks
            yield False
        else:
            yield True


@cache
def _announce() -> None:
    _log.info("compiling finite-element forms (once per machine, ~20 s)")


@cache
def _processor() -> str:
    """Return a hash of what ``-march=native`` depends on."""
    described = [platform.machine(), platform.processor()]
    information = Path("/proc/cpuinfo")
    if information.exists():
        wanted = ("model name", "flags", "Features", "CPU part")
        lines = information.read_text().split("\n\n")[0].splitlines()
        described += [line for line in lines if line.startswith(wanted)]
    return hashlib.sha256("\n".join(described).encode()).hexdigest()[:8]
