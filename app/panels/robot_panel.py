"""The robot of the chosen arm: which it is, where it stands, and its arm, tool and hand."""

from __future__ import annotations

import numpy as np
import viser

from ..choices.robot_arms import IN_URDF, MOUNTABLE, hand_option, tool_link, tool_links
from ..choices.robot_choice import robot_options
from ..files.archives import ARCHIVE_LIMIT
from ..state import changes, robot_changes
from ..state.object_pose import ObjectPose
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["RobotPanel"]

FARTHEST = 1000.0
"""Largest coordinate (cm) of a robot."""


class RobotPanel(Panel):
    """Chooses robot, arm, tool and hand, and places the robot."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        with gui.add_folder("Robot", expand_by_default=False):
            self.robot = self.dropdown(
                "Robot", robot_options(), hint="In place of the robot of the chosen arm."
            )
            self.on_select(self.robot, actions.choose_robot)
            self.upload = self.upload_button(
                "Upload a robot", ARCHIVE_LIMIT, actions.upload_robot,
                mime_type=".zip,.urdf,.xacro,.xml",
                hint=f"A ZIP file of a URDF, xacro or MJCF file with its meshes, or such a file alone; "
                f"at most {ARCHIVE_LIMIT / 1e6:g} MB",
            )  # fmt: skip
            self.arm = self.dropdown("Its arm", hint="Which arm of it does what the chosen one does.")
            self.on(self.arm, lambda s, v: robot_changes.use_arm(s, v))
            self.tool = self.dropdown("Tool link", hint="Where the hand is, or is mounted.")
            self.on_select(self.tool, actions.choose_tool)
            self.hand = self.dropdown("Hand", (IN_URDF, *MOUNTABLE))
            self.on_select(self.hand, actions.choose_hand)
            self.position = {
                axis: gui.add_number(f"Base {axis} (cm)", 0.0, min=-FARTHEST, max=FARTHEST, step=0.1)
                for axis in ("x", "y", "z")
            }
            for axis, number in self.position.items():
                self.on(
                    number,
                    lambda s, v, axis=axis: robot_changes.place_robot(s, **{axis: v / 100}),
                    "inputs",
                )
            self.turn = gui.add_number("Base turn (°)", 0.0, min=-180.0, max=180.0, step=0.1)
            self.on(self.turn, lambda s, v: robot_changes.place_robot(s, spin=np.deg2rad(v)), "inputs")
            self.gizmo = gui.add_checkbox("Base handles", False)
            self.on(self.gizmo, lambda s, v: changes.switched(s, base_handles=v))

    def show(self, state: State) -> None:
        """Offer the robots that there are, and the arms and links of the one that is shown."""
        if self.robot.options != (options := robot_options(state.uploaded_robot)):
            self.robot.options = options
        arms = tuple(arm.name for arm in state.scene.arms.values() if arm.robot is state.robot)
        if self.arm.options != arms:
            self.arm.options = arms
        if self.tool.options != (links := tool_links(state.scene, state.arm)):
            self.tool.options = links

    def write_inputs(self, state: State) -> None:
        """Set what is chosen."""
        self.robot.value = state.robot_option
        self.arm.value = state.arm
        self.arm.visible = len(self.arm.options) > 1
        self.tool.value, self.hand.value = (
            tool_link(state.scene, state.arm),
            hand_option(state.scene, state.arm),
        )
        pose = ObjectPose.of(state.robot.T_world_base)
        for axis, number in self.position.items():
            number.value = round(100 * getattr(pose, axis), 3)
        self.turn.value = round(float(np.rad2deg(pose.spin)), 3)
        self.gizmo.value = state.display.base_handles
