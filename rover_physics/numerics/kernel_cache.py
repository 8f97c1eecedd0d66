# SPDX-License-Identifier: Apache-2.0
"""Keeps compiled kernels on disk; a disk that cannot be read or written ends no program."""

import contextlib
import functools
import hashlib
import inspect
import tempfile
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, ClassVar

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

PACKAGE = Path(__file__).parents[1]
"""Folder of the package whose kernels are cached."""

KERNEL_SIZE = 1 << 20
"""Space that a large kernel takes on disk [bytes]."""

_notes: list[str] = []
_only_load: ContextVar[bool] = ContextVar("only_load", default=False)


class KernelMissingError(Exception):
    """A kernel is not on disk, in a block that only loads kernels."""


@contextlib.contextmanager
def loading_only() -> Iterator[None]:
    """Raise KernelMissingError in this block and thread where a kernel would be compiled."""
    token = _only_load.set(True)
    try:
        yield
    finally:
        _only_load.reset(token)


def kernel_cache_note() -> str:
    """Return why kernels could not be saved, such as a full disk; empty if all could be."""
    return _notes[0] if _notes else ""


def digest_sources(package: Path) -> str:
    """Return a hash of the names and contents of all Python files below a folder."""
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()


SOURCES = digest_sources(PACKAGE)
"""Hash of the package's sources. A kernel on disk counts only with the same hash: Numba checks
only the file of a kernel, not the files of the kernels that it calls."""


@functools.lru_cache
def _digest_file(file: str) -> str:
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


_InTreeLocator: Any = next(
    kind
    for kind in CompileResultCacheImpl._locator_classes
    if kind.__name__.lstrip("_") == "InTreeCacheLocator"  # with an underscore before Numba 0.61
)


class _LastLocator(_InTreeLocator):
    """The folder beside the source where no folder can be written: kernels in it are loaded."""

    @classmethod
    def from_function(cls, function, file):
        return cls(function, file)


class _KernelCacheImpl(CompileResultCacheImpl):
    """Numba's choice of a folder, which raises where none can be written, with a last one."""

    _locator_classes: ClassVar = [*CompileResultCacheImpl._locator_classes, _LastLocator]


class KernelCache(FunctionCache):
    """Numba's cache of one function, whose faults only cost the time to compile again."""

    _impl_class = _KernelCacheImpl

    def __init__(self, function):
        super().__init__(function)
        self._cache_file = IndexDataCacheFile(
            cache_path=self.cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=(SOURCES, _digest_file(inspect.getfile(function))),
        )

    def load_overload(self, sig, target_context):
        """Return the compiled function, None if there is none or its file is damaged.

        Raises:
            KernelMissingError: There is none, and kernels are only to be loaded.
        """
        try:
            # Numba's own method first prepares to compile, which takes a third of a second.
            rtsys.initialize(target_context)
            found = self._load_overload(sig, target_context)
        except Exception:
            with contextlib.suppress(OSError):
                self.flush()  # a damaged index would also prevent that the kernel is saved
            found = None
        if found is None and _only_load.get():
            raise KernelMissingError(self._name)
        return found

    def save_overload(self, sig, data):
        """Save the compiled function, or note why it cannot be saved."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _notes.append(f"{error.strerror or error}: {self.cache_path}")
        except Exception as error:
            _notes.append(f"{type(error).__name__}: {error}")


def kernel_folder() -> Path:
    """Return the folder of the kernels of this file; those of other files are beside it."""
    return Path(_KernelCacheImpl(digest_sources).locator.get_cache_path())


def can_save_kernels() -> bool:
    """Return whether there is a folder for kernels that can be written, with space for one."""
    try:
        with tempfile.TemporaryFile(dir=kernel_folder()) as file:
            file.write(bytes(KERNEL_SIZE))
    except OSError:
        return False
    return True


def drop_stale_kernels() -> None:
    """Remove all kernels in the package's folders if any of its sources has changed.

    They would not be loaded; their number would grow with each edit.
    """
    stamp = PACKAGE / "__pycache__" / "kernels.sha256"
    try:
        if stamp.exists() and stamp.read_text() == SOURCES:
            return
        stamp.parent.mkdir(exist_ok=True)
        for cache in PACKAGE.rglob("__pycache__"):
            for compiled in [*cache.glob("*.nbi"), *cache.glob("*.nbc")]:
                compiled.unlink(missing_ok=True)
        stamp.write_text(SOURCES)
    except OSError:
        return  # a folder that cannot be written keeps what it has
