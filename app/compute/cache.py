"""The cache that all sessions share: loaded scenes and computed maps."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

from symgrasp.errors import SceneError, one_of
from symgrasp.files import SCENES_DIR
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes
from symgrasp.world import prepared

from ..choices.object_choice import OWN, ObjectChoice, from_library
from ..files.links import Link
from ..scene3d.visual_meshes import read_visuals
from ..state.requests import MapKey, MapRequest, MapResult

__all__ = ["SharedCache"]

MAX_MAPS = 64
"""How many maps are kept, the most recently used; one of 96 x 192 cells takes about 4 MB."""

MAX_POSES = 6
"""How many of them may differ only in pose: a drag computes dozens that are never needed again."""


class SharedCache:
    """Scenes by name and maps by content; thread-safe.

    Args:
        first: the scene the page opens with, a shipped name or a file.
        holds_first: whether a page that is opened without a link begins with the arm at a good grasp.

    Raises:
        InputError: that scene is unusable.

    Attributes:
        first: the scene the page opens with.
        holds_first: see above.
        names: the scenes that can be opened by name.
        folders: where the files of an uploaded scene may lie.
    """

    def __init__(self, first: str, *, holds_first: bool = False) -> None:
        self._lock = threading.Lock()
        self._scenes: dict[str, Scene] = {}
        self._with_object: dict[tuple[str, str], tuple[Scene, ObjectChoice]] = {}
        self._maps: OrderedDict[MapKey, MapResult] = OrderedDict()
        self.first, self.holds_first = first, holds_first
        self.names = tuple(dict.fromkeys([first, *shipped_scenes()]))
        own = [] if first in shipped_scenes() else [Path(first).resolve().parent]
        self.folders = (*own, SCENES_DIR)
        self.scene(first)

    def scene(self, name: str, progress: Progress | None = None) -> Scene:
        """Return a scene by one of `names`; it is loaded and checked once.

        Args:
            name: of the scene.
            progress: called with the finished share while it is loaded; may raise `Cancelled`.

        Raises:
            InputError: it is unusable.
        """
        with self._lock:
            scene = self._scenes.get(name)
        if scene:
            return scene
        if name not in self.names:  # else a browser could open any file of the server
            raise SceneError("page", "scene", name, one_of(self.names, name))
        scene = prepared(Scene.load(name), progress)
        read_visuals(scene, progress)
        with self._lock:
            return self._scenes.setdefault(name, scene)

    def scene_with(self, name: str, option: str) -> tuple[Scene, ObjectChoice | None]:
        """Return a scene by name with its own object or one of the library, and the object if of the library.

        Raises:
            InputError: one of them is unusable, or they do not go together.
        """
        scene = self.scene(name)
        if option == OWN:
            return scene, None
        with self._lock:
            cached = self._with_object.get((name, option))
        if cached:
            return cached
        choice = from_library(option)
        changed = scene.with_object(choice.name, choice.profile), choice
        with self._lock:
            return self._with_object.setdefault((name, option), changed)

    def linked(
        self, link: Link, mount: Callable[[Scene, str, str], Scene]
    ) -> tuple[Scene, ObjectChoice | None]:
        """Return the scene of a link with its object and hands.

        Args:
            link: the link.
            mount: returns a scene with a hand on an arm, by their names.

        Raises:
            InputError: there is no scene, object or hand of a name, or they do not fit.
        """
        scene, choice = self.scene_with(link.scene or self.first, link.object or OWN)
        for arm, hand in link.hand.items():
            if scene.replaceable_hands.get(arm) != hand:
                scene = mount(scene, arm, hand)
        return scene, choice

    def map(self, request: MapRequest) -> MapResult | None:
        """Return the cached map of a request, renamed to its scene and task; None if there is none."""
        with self._lock:
            cached = self._maps.get(request.key)
            if cached:
                self._maps.move_to_end(request.key)
        return cached.renamed(request) if cached else None

    def keep(self, result: MapResult) -> None:
        """Add a map, and drop the least recently used beyond `MAX_MAPS` and `MAX_POSES`."""
        with self._lock:
            self._maps[result.request.key] = result
            requests = [cached.request for cached in self._maps.values()]
            alike = [r for r in requests if r.pose and r.differs_only_in_pose(result.request)]
            for request in alike[:-MAX_POSES]:
                del self._maps[request.key]
            while len(self._maps) > MAX_MAPS:
                self._maps.popitem(last=False)
