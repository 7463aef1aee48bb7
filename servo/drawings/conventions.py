#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes conventions.svg beside this file: frames, joints and signs of the C-arm.

Places are computed from the formulas of modules/geometry/src/carm.cpp (beamDirection, viewRotation), in mm along the
patient's axes L, P, S with the isocentre at the origin. Python's standard library only.
"""
import math
import pathlib

WIDTH, HEIGHT = 900, 880
SOURCE_ISOCENTRE, SOURCE_DETECTOR = 810, 1113  # [mm]; CArmGeometry's
PX_PER_MM = 0.29
INK, SOFT, JOINT, BEAM, ARM = "#222", "#666", "#c24e00", "#f3d98b", "#8a8f96"
AXIS = {"L": "#c1121f", "P": "#2a7f3f", "S": "#1d4ed8", "x": "#7a1fa2", "y": "#7a1fa2", "z": "#7a1fa2"}

parts = []


def add(text):
    parts.append(text)


def text(x, y, words, size=14, color=INK, anchor="start", bold=False, halo=True):
    weight = ' font-weight="bold"' if bold else ""
    outline = ' paint-order="stroke" stroke="#fff" stroke-width="4" stroke-linejoin="round"' if halo else ""
    words = words.replace("&", "&amp;").replace("<", "&lt;")
    add(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{color}" text-anchor="{anchor}"{weight}{outline}>{words}</text>')


def line(a, b, color=INK, width=1.5, dash=""):
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    add(f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="{color}" stroke-width="{width}"{dashes}/>')


def head(at, angle, color, size=9):
    corners = [(0, 0), (-size, 0.42 * size), (-size, -0.42 * size)]
    c, s = math.cos(angle), math.sin(angle)
    points = " ".join(f"{at[0] + c * x - s * y:.1f},{at[1] + s * x + c * y:.1f}" for x, y in corners)
    add(f'<polygon points="{points}" fill="{color}"/>')


def arrow(a, b, color=INK, width=2.2):
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    line(a, (b[0] - 6 * math.cos(angle), b[1] - 6 * math.sin(angle)), color, width)
    head(b, angle, color)


def through(at, away, color):
    """An axis across the page: away from the reader, or towards him."""
    x, y = at
    add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="7" fill="#fff" stroke="{color}" stroke-width="2"/>')
    if away:
        line((x - 4.5, y - 4.5), (x + 4.5, y + 4.5), color, 2)
        line((x - 4.5, y + 4.5), (x + 4.5, y - 4.5), color, 2)
    else:
        add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{color}"/>')


def polygon(points, fill, stroke="none", width=1.0, dash="", opacity=1.0):
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    joined = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    add(f'<polygon points="{joined}" fill="{fill}" stroke="{stroke}" stroke-width="{width}" opacity="{opacity}"{dashes}/>')


def beam_direction(primary_deg, secondary_deg):
    p, s = math.radians(primary_deg), math.radians(secondary_deg)
    return (math.sin(p) * math.cos(s), -math.cos(p) * math.cos(s), math.sin(s))


def view_rotation(primary_deg, secondary_deg):
    """Rows: the image's right, the image's down, the beam."""
    p = math.radians(primary_deg)
    z = beam_direction(primary_deg, secondary_deg)
    x = (-math.cos(p), -math.sin(p), 0.0)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return x, y, z


class Section:
    """A view of the lab along one of the patient's axes: `across` to the right, P down."""

    def __init__(self, isocentre_px, across, left_letter, right_letter):
        self.centre, self.across = isocentre_px, across
        self.left, self.right = left_letter, right_letter

    def flat(self, v):
        return (v[self.across], v[1])

    def px(self, v):
        f = self.flat(v)
        return (self.centre[0] + PX_PER_MM * f[0], self.centre[1] + PX_PER_MM * f[1])

    def arm(self, primary_deg, secondary_deg, ghost):
        _, _, z = view_rotation(primary_deg, secondary_deg)
        source = tuple(-SOURCE_ISOCENTRE * c for c in z)
        middle = tuple((SOURCE_DETECTOR - SOURCE_ISOCENTRE) * c for c in z)
        side = (-self.flat(z)[1], self.flat(z)[0])  # In the page, across the beam.

        def at(v, aside):
            p = self.px(v)
            return (p[0] + PX_PER_MM * aside * side[0], p[1] + PX_PER_MM * aside * side[1])

        half = 130
        if ghost:
            line(self.px(source), self.px(middle), SOFT, 1.2, "5 4")
            line(at(middle, -half), at(middle, half), SOFT, 3, "6 4")
            add(f'<circle cx="{self.px(source)[0]:.1f}" cy="{self.px(source)[1]:.1f}" r="5" fill="#fff" stroke="{SOFT}" stroke-width="1.5"/>')
            return self.px(middle)
        polygon([self.px(source), at(middle, -half), at(middle, half)], BEAM, opacity=0.5)
        polygon([at(middle, -half), at(middle, half), at(tuple(1.13 * c for c in middle), half),
                 at(tuple(1.13 * c for c in middle), -half)], "#c9ced6", ARM, 1.5)
        s = self.px(source)
        add(f'<circle cx="{s[0]:.1f}" cy="{s[1]:.1f}" r="7" fill="{INK}"/>')
        return self.px(middle)

    def turn(self, angles, radius_mm, label, label_at, anchor):
        """The way of a joint from zero, by the way of the detector."""
        points = []
        for k in range(41):
            z = beam_direction(*[a * k / 40 for a in angles])
            points.append(self.px(tuple(radius_mm * c for c in z)))
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points[:-1])
        add(f'<polyline points="{path}" fill="none" stroke="{JOINT}" stroke-width="2.6"/>')
        head(points[-1], math.atan2(points[-1][1] - points[-4][1], points[-1][0] - points[-4][0]), JOINT, 12)
        for i, words in enumerate(label):
            text(label_at[0], label_at[1] + 17 * i, words, 14, SOFT if i == 2 else JOINT, anchor, bold=i == 0)


def isocentre_axes(section, in_page, through_axis, away):
    c = section.centre
    for letter, vector in in_page:
        p = section.px(vector)
        arrow(c, p, AXIS[letter], 2.6)
        sign = 1 if vector[section.across] else 0
        text(p[0] + (6 if sign else -16), p[1] + (5 if sign else 4), letter, 16, AXIS[letter], bold=True)
    through(c, away, AXIS[through_axis])
    text(c[0] - 22, c[1] - 9, through_axis, 16, AXIS[through_axis], bold=True)


def camera_axes(section, in_page, through_axis, away, aside):
    x, y, z = view_rotation(0, 0)
    axes = {"x": x, "y": y, "z": z}
    source = tuple(-SOURCE_ISOCENTRE * c for c in z)
    origin = section.px(source)
    for name in in_page:
        end = section.px(tuple(s + 190 * c for s, c in zip(source, axes[name])))
        arrow(origin, end, AXIS[name], 2.2)
        along = section.flat(axes[name])
        text(end[0] + (7 if along[1] else 8 * along[0] - 4), end[1] + (8 if along[1] else -6), name, 15, AXIS[name], bold=True)
    through(origin, away, AXIS[through_axis])
    text(origin[0] + 10, origin[1] + 17, through_axis, 15, AXIS[through_axis], bold=True)
    text(origin[0] + aside, origin[1] + 5, "source = camera frame's origin", 13, SOFT, "start" if aside > 0 else "end")


def table(section, half_width):
    top = 115
    c = section.centre
    y = c[1] + PX_PER_MM * top
    add(f'<rect x="{c[0] - PX_PER_MM * half_width:.1f}" y="{y:.1f}" width="{2 * PX_PER_MM * half_width:.1f}" height="9" fill="#b08968" rx="2"/>')
    return y + 4


def from_the_feet():
    s = Section((225, 175), 0, "R", "L")
    text(20, 28, "Seen from the feet, at 0, 0", 17, bold=True)
    s.arm(0, 0, ghost=False)
    s.arm(30, 0, ghost=True)
    y = table(s, 230)
    c = s.centre
    add(f'<ellipse cx="{c[0]}" cy="{c[1]}" rx="{PX_PER_MM * 185:.1f}" ry="{PX_PER_MM * 112:.1f}" fill="#e9dfd6" stroke="#a58f80" stroke-width="1.5" fill-opacity="0.75"/>')
    isocentre_axes(s, [("L", (300, 0, 0)), ("P", (0, 260, 0))], "S", away=True)
    s.turn((30, 0), 380, ["primary + [rad]", "LAO; - is RAO", "dashed: LAO 30"], (295, 58), "start")
    camera_axes(s, ["x", "z"], "y", away=False, aside=24)
    x_right = c[0] + PX_PER_MM * 230
    arrow((x_right + 8, y + 24), (x_right + 58, y + 24), JOINT, 2.6)
    text(x_right + 8, y + 44, "table x + [m]", 14, JOINT, bold=True)
    text(x_right + 8, y + 61, "to the left", 14, JOINT)
    arrow((c[0] - PX_PER_MM * 260, y - 16), (c[0] - PX_PER_MM * 260, y + 34), JOINT, 2.6)
    text(c[0] - PX_PER_MM * 260 - 8, y + 10, "table y + [m]", 14, JOINT, "end", bold=True)
    text(c[0] - PX_PER_MM * 260 - 8, y + 27, "down", 14, JOINT, "end")
    text(c[0] - 46, 72, "detector", 13, SOFT, "end")
    text(c[0] - 62, c[1] - 34, "isocentre", 13, SOFT, "end")
    line((c[0] - 60, c[1] - 34), (c[0] - 6, c[1] - 5), SOFT, 1)


def from_the_left():
    s = Section((675, 175), 2, "F", "H")
    text(470, 28, "Seen from the patient's left, at 0, 0", 17, bold=True)
    s.arm(0, 0, ghost=False)
    s.arm(0, 30, ghost=True)
    y = table(s, 560)
    c = s.centre
    k = PX_PER_MM
    add(f'<ellipse cx="{c[0] + k * 395:.1f}" cy="{c[1] + 3:.1f}" rx="{k * 110:.1f}" ry="{k * 95:.1f}" fill="#e9dfd6" stroke="#a58f80" stroke-width="1.5"/>')
    add(f'<path d="M {c[0] + k * 290:.1f} {c[1] - k * 60:.1f} C {c[0] + k * 150:.1f} {c[1] - k * 130:.1f}, {c[0] - k * 250:.1f} {c[1] - k * 115:.1f}, {c[0] - k * 540:.1f} {c[1] - k * 10:.1f} '
        f'L {c[0] - k * 540:.1f} {c[1] + k * 110:.1f} L {c[0] + k * 290:.1f} {c[1] + k * 110:.1f} Z" fill="#e9dfd6" stroke="#a58f80" stroke-width="1.5" fill-opacity="0.75"/>')
    isocentre_axes(s, [("S", (0, 0, 250)), ("P", (0, 260, 0))], "L", away=False)
    s.turn((0, 30), 380, ["secondary + [rad]", "CRA; - is CAU", "dashed: CRA 30"], (745, 58), "start")
    camera_axes(s, ["y", "z"], "x", away=True, aside=24)
    arrow((c[0] + k * 330, y + 24), (c[0] + k * 330 + 56, y + 24), JOINT, 2.6)
    text(c[0] + k * 330, y + 44, "table z + [m]", 14, JOINT, bold=True)
    text(c[0] + k * 330, y + 61, "to the head", 14, JOINT)
    text(c[0] + k * 395, c[1] + 8, "head", 13, SOFT, "middle", halo=False)
    text(c[0] - k * 520, c[1] + 24, "to the feet", 13, SOFT, halo=False)
    # Distances beside the beam.
    top, bottom = c[1] - k * (SOURCE_DETECTOR - SOURCE_ISOCENTRE), c[1] + k * SOURCE_ISOCENTRE
    for x, upper, words in ((c[0] - 172, c[1], "source_isocentre_distance"), (c[0] - 192, top, "source_detector_distance")):
        line((x, upper), (x, bottom), SOFT, 1)
        for yy in (upper, bottom):
            line((x - 4, yy), (x + 4, yy), SOFT, 1)
        add(f'<text transform="translate({x - 5:.1f} {0.5 * (c[1] + bottom) + 10:.1f}) rotate(-90)" font-size="12" fill="{SOFT}" text-anchor="middle" paint-order="stroke" stroke="#fff" stroke-width="4">{words}</text>')


def image():
    left, top, side = 60, 545, 190
    text(20, 500, "The image at 0, 0", 17, bold=True)
    text(20, 520, "as one sees it from the source", 13, SOFT)
    add(f'<rect x="{left}" y="{top}" width="{side}" height="{side}" fill="#e4e6ea" stroke="{ARM}" stroke-width="1.5"/>')
    vessels = [((95, 190), (98, 130), (86, 92), (100, 52)), ((98, 130), (130, 105), (150, 62)), ((86, 92), (52, 76), (36, 44)),
               ((130, 105), (162, 108))]
    for vessel in vessels:
        path = " ".join(f"{left + x},{top + y}" for x, y in vessel)
        add(f'<polyline points="{path}" fill="none" stroke="#5b6068" stroke-width="4" stroke-linejoin="round" stroke-linecap="round"/>')
    middle = (left + side / 2, top + side / 2)
    for words, x, y in (("L", left - 16, middle[1] + 6), ("R", left + side + 16, middle[1] + 6), ("H", middle[0], top - 8),
                        ("F", middle[0], top + side + 22)):
        text(x, y, words, 18, INK, "middle", bold=True)
    corner = (left, top)
    arrow(corner, (left + 62, top), AXIS["x"], 2.6)
    arrow(corner, (left, top + 62), AXIS["y"], 2.6)
    text(left + 56, top - 8, "x", 15, AXIS["x"], bold=True)
    text(left - 16, top + 60, "y", 15, AXIS["y"], bold=True)
    through((left + 26, top + 26), True, AXIS["z"])
    text(left + 38, top + 31, "z, to the detector", 13, AXIS["z"], halo=False)
    text(left - 34, top - 8, "pixel 0, 0", 12, SOFT)
    for i, words in enumerate(("L, R, H, F: the patient's left, right, head, feet.", "At LAO 90 the patient's front is on the",
                               "image's right, the head up.", "Camera frame: x right, y down, z = the beam.",
                               "Radians and metres, in code and on the bus.")):
        text(20, 778 + 19 * i, words, 13, SOFT)


def box(x, y, width, height, title, lines):
    add(f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="#f6f7f9" stroke="{ARM}" stroke-width="1.5"/>')
    text(x + 12, y + 22, title, 14, INK, bold=True, halo=False)
    for i, words in enumerate(lines):
        text(x + 12, y + 42 + 18 * i, words, 13, SOFT, halo=False)


def frames():
    x, width = 385, 330
    text(x, 500, "From the tree's file to the image", 17, bold=True)
    box(x, 515, width, 62, "model", ["The tree's own frame: x, y, z of its file."])
    box(x, 640, width, 80, "patient", ["Axes L, P, S of a patient who lies straight; origin",
                                       "at the isocentre when the table is at 0, 0, 0."])
    box(x, 783, width, 62, "camera", ["Origin at the source; x right, y down, z the beam."])
    for top, name, words in ((577, "T_dsa_cb", ""), (720, "T_camera_patient(joints)", "")):
        arrow((x + 30, top + 3), (x + 30, top + 60), INK, 2.2)
        text(x + 44, top + 28, name, 15, INK, bold=True)
    text(x + 44, 577 + 47, "p_patient = T_dsa_cb p_model", 13, SOFT)
    text(x + 44, 720 + 47, "p_iso = table + p_patient, then by the angles", 13, SOFT)
    # The anatomy's own axes.
    ax = x + width + 26
    arrow((x + width + 2, 546), (ax + 18, 546), INK, 2.2)
    text(ax + 22, 538, "R_lps_model", 15, INK, bold=True)
    for i, words in enumerate(("the anatomy's own", "L, P, S, in which", "LAO and CRA of a", "wanted view count")):
        text(ax + 22, 557 + 17 * i, words, 13, SOFT)


def main():
    add(f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="Helvetica, Arial, sans-serif">')
    add(f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>')
    line((450, 14), (450, 462), "#ddd", 1)
    line((14, 470), (WIDTH - 14, 470), "#ddd", 1)
    from_the_feet()
    from_the_left()
    image()
    frames()
    add("</svg>")
    pathlib.Path(__file__).with_suffix(".svg").write_text("\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
