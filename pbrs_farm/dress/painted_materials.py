"""Materials and textures of a house during dressing; a thread paints some of them until close()."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from threading import Lock
from typing import NamedTuple, overload

from pbrs_farm.core.house import Material, Texture


class Painted(NamedTuple):
    """A painted material."""

    material: Material
    textures: tuple[Texture, ...]  # those that the material names
    mean_rgb: tuple[float, float, float]  # mean linear colour


class Painting:
    """A task painted once, by the thread or by its first user."""

    def __init__(self, paint: Callable[[], Painted]) -> None:
        self._paint = paint
        self._lock = Lock()
        self._painted: Painted | None = None

    def painted(self) -> Painted:
        """The result, painted now or waited for if it is not ready. Raises the task's error."""
        with self._lock:
            if self._painted is None:
                self._painted = self._paint()
            return self._painted


class PaintedMaterials(Sequence[Material]):
    """Materials by number; reading one that is not painted yet waits for it, and raises its error."""

    def __init__(self, materials: Iterable[Material], textures: Mapping[str, Texture]) -> None:
        self._all: list[Material | Painting] = list(materials)
        # In the order in which they came, repeated ones too.
        self._textures: list[tuple[str, Texture] | Painting] = list(textures.items())
        self._number = {m: i for i, m in reversed(list(enumerate(self)))}

    def __len__(self) -> int:
        return len(self._all)

    @overload
    def __getitem__(self, number: int) -> Material: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[Material]: ...
    def __getitem__(self, number: int | slice) -> Material | Sequence[Material]:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        entry = self._all[number]
        if not isinstance(entry, Painting):
            return entry
        # Equal materials added later get this index.
        material = entry.painted().material
        self._number.setdefault(material, number % len(self._all))
        return material

    def add(self, material: Material, textures: Iterable[Texture]) -> int:
        """Index of a material with its textures, the same for equal ones, finished painted ones too."""
        self._textures += ((t.id, t) for t in textures)
        if material not in self._number:
            self._number[material] = len(self._all)
            self._all.append(material)
        return self._number[material]

    def paint(self, paint: Callable[[], Painted]) -> tuple[int, Painting]:
        """The number of a new material and its painting, which a thread begins after the others."""
        painting = Painting(paint)
        self.painter.submit(painting.painted)
        self._textures.append(painting)
        self._all.append(painting)
        return len(self._all) - 1, painting

    def close(self) -> None:
        """Stop the thread after its current task."""
        if "painter" in self.__dict__:
            self.painter.shutdown(wait=False, cancel_futures=True)

    def textures(self) -> dict[str, Texture]:
        """All textures by id, in the order of addition; waits for unfinished ones."""
        textures: dict[str, Texture] = {}
        for row in self._textures:
            if isinstance(row, Painting):
                textures.update((t.id, t) for t in row.painted().textures)
            else:
                textures[row[0]] = row[1]
        return textures

    @cached_property
    def painter(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(1, "paint")
