"""Scene files, the link to the page, the 3D view as a file, and the dark theme."""

from __future__ import annotations

from html import escape

import viser

from ..files.archives import ARCHIVE_LIMIT
from ..files.scene_files import SCENE_LIMIT
from ..state import changes
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["FilesPanel", "link_html"]


class FilesPanel(Panel):
    """Saves and opens scenes, makes links, and saves the 3D view."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Scene file"):
            self.button(
                "Save the scene (YAML)", viser.Icon.DOWNLOAD, actions.save_scene, color="gray",
                hint="With robots, object, hands and poses as they are now; as a ZIP file, with their files, "
                "where robots were uploaded",
            )  # fmt: skip
            self.upload = self.upload_button(
                "Open a scene (YAML or ZIP)", ARCHIVE_LIMIT, actions.upload_scene,
                mime_type=".yaml,.yml,.zip",
                hint=f"At most {SCENE_LIMIT / 1e6:g} MB; or a ZIP file of a scene with its robots, at most "
                f"{ARCHIVE_LIMIT / 1e6:g} MB",
            )  # fmt: skip
        with gui.add_folder("Share"):
            self.button(
                "Make a link", viser.Icon.LINK, actions.make_link, color="gray",
                hint="Opens the same scene, poses, grasp and view on this server; not robots that were "
                "changed: save the scene for these",
            )  # fmt: skip
            self.link = self.html()
            self.button(
                "Save the 3D view (HTML)", viser.Icon.FILE_EXPORT, actions.save_3d_view, color="gray",
                hint="One file, to be opened anywhere without a network",
            )  # fmt: skip
        self.dark = gui.add_checkbox("Dark", False)
        self.on(self.dark, lambda s, v: changes.switched(s, dark=v))

    def show(self, state: State) -> None:
        """Show the link that was made last, and whether it is still up to date."""
        self.link.show(link_html(state))

    def write_inputs(self, state: State) -> None:
        """Set the checkbox."""
        self.dark.value = state.display.dark


def link_html(state: State) -> str:
    """Return the link that was made last, with a note where the page has changed since."""
    if state.link is None:
        return ""
    address = escape(state.link.address, quote=True)
    earlier = '<div class="sg-note sg-warning">The page has changed since: this opens it as it was.</div>'
    note = "" if state.link.values == state.link_values else earlier
    return f'<div class="sg"><a class="sg-link" href="{address}">{address}</a>{note}</div>'
