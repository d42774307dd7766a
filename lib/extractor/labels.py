"""The vocabulary of each category: PartNet's labels in the order in which a program mentions them, and which nodes of
the hierarchy are rearranged (ShapeAssembly paper, Appendix C, "Semantic Hierarchy Arrangement").

The order is the one the authors' data set was made with; a label outside it comes last.
"""

RANKED = {
    "chair": """
        chair chair_base chair_seat chair_back chair_arm chair_head footrest leg runner foot bar_stretcher rocker
        pedestal central_support caster wheel caster_stem mechanical_control knob lever seat_surface
        seat_single_surface seat_surface_bar seat_frame seat_frame_bar seat_holistic_frame seat_support back_surface
        back_single_surface back_surface_vertical_bar back_frame_vertical_bar back_surface_horizontal_bar
        back_frame_horizontal_bar back_frame back_holistic_frame back_connector back_support arm_sofa_style
        arm_horizontal_bar arm_near_vertical_bar arm_writing_table arm_holistic_frame arm_connector headrest
        head_connector""".split(),
    "table": """
        table regular_table table_base tabletop tabletop_surface board glass tabletop_frame bar tabletop_dropleaf leg
        runner pedestal foot caster circular_stretcher bar_stretcher bottom_panel back_panel vertical_front_panel
        vertical_side_panel vertical_divider_panel tabletop_connector central_support shelf cabinet_door drawer
        keyboard_tray""".split(),
    "storage": """
        storage_furniture cabinet cabinet_base panel_base foot_base cabinet_frame bottom_panel frame_vertical_bar
        vertical_side_panel vertical_divider_panel top_panel countertop back_panel vertical_front_panel
        frame_horizontal_bar shelf drawer mirror cabinet_door base_side_panel foot caster""".split(),
}

# Nodes that become leaves: what is inside them is detail.
COLLAPSED = {
    "chair": {"caster", "mechanical_control"},
    "table": {"caster", "cabinet_door", "drawer", "keyboard_tray"},
    "storage": {"drawer", "cabinet_door", "mirror", "caster"},
}
# Nodes whose leaves become their direct children, so that parts that touch are siblings.
FLATTENED = {
    "chair": {"chair_back", "chair_arm", "chair_base", "chair_seat", "footrest", "chair_head"},
    "table": {"tabletop", "table_base"},
    "storage": {"cabinet_frame", "cabinet_base"},
}
# Children of the root that move into the cabinet's frame, which holds them.
HELD_BY_FRAME = {"storage": {"countertop", "shelf", "drawer", "cabinet_door", "mirror"}}
FRAME = "cabinet_frame"
