"""The hopper and what may stand in it: sections of the configuration, and the profiles they mean."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from hopperopt import geometry
from hopperopt.config.fields import MM, Coordinate, Length, Model, Number, Slope


class Hopper(Model):
    """A conical hopper below a cylinder."""

    outlet_radius_mm: Length = 22.5
    """Radius of the outlet."""
    half_angle_deg: Annotated[float, Number(least=1, most=90)] = 45.0
    """Angle of the cone's wall from the vertical; 90 is a flat bottom."""
    cylinder_radius_mm: Length = 50.0
    """Radius of the cylinder above the cone."""

    @property
    def _shape(self):
        return self.outlet_radius_mm / MM, self.half_angle_deg, self.cylinder_radius_mm / MM

    @property
    def cone_top(self):
        """Height of the cone's upper edge (m)."""
        return geometry.cone_height(*self._shape)

    def profile(self, top):
        """The wall from the outlet up to `top` (m)."""
        return geometry.hopper(*self._shape, max(top, self.cone_top))


class Cone(Model):
    """A solid cone, apex up: slope angle from the horizontal, length along the slope."""

    slope_deg: Slope = 55.0
    """Slope from the horizontal."""
    length_mm: Length = 40.0
    """Length along the slope, from the edge of the base to the apex."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.cone(self.slope_deg, self.length_mm / MM)


class DoubleCone(Model):
    """Two solid cones base to base: slope angles from the horizontal, length along the upper slope."""

    lower_slope_deg: Slope = 60.0
    """Slope of the lower cone, from the horizontal."""
    upper_slope_deg: Slope = 55.0
    """Slope of the upper cone, from the horizontal."""
    length_mm: Length = 30.0
    """Length along the upper cone's slope, which sets the radius of the common base."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.double_cone(self.lower_slope_deg, self.upper_slope_deg, self.length_mm / MM)


class Bullet(Model):
    """A solid cylinder below a conical nose."""

    radius_mm: Length = 20.0
    """Radius of the cylinder."""
    cylinder_length_mm: Length = 10.0
    """Height of the cylinder."""
    nose_slope_deg: Slope = 55.0
    """Slope of the nose, from the horizontal."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.bullet(self.radius_mm / MM, self.cylinder_length_mm / MM, self.nose_slope_deg)


class ConeInCone(Model):
    """A hollow cone, wide end up, open at both ends; its upper rim falls outwards: nothing rests on it."""

    slope_deg: Slope = 70.0
    """Slope of the inner face, from the horizontal."""
    length_mm: Length = 30.0
    """Length along the inner face."""
    opening_radius_mm: Length = 12.0
    """Radius of the opening at the bottom, inside."""
    thickness_mm: Length = 2.0
    """Thickness of the sheet."""

    def profile(self):
        """Profile above the insert's height (m)."""
        sizes = (self.length_mm, self.opening_radius_mm, self.thickness_mm)
        return geometry.cone_in_cone(self.slope_deg, *(size / MM for size in sizes))


class Profile(Model):
    """A body of one's own: points r, z (z from the insert's height), in a CSV file or typed in."""

    file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """CSV file with the columns `r_mm` and `z_mm`, from one end of the line to the other; z from the
    insert's height. A line with both ends on the axis, or one that closes, is a solid body, any other a
    shell without thickness."""
    points_mm: Annotated[
        tuple[tuple[Coordinate, Coordinate], ...] | None, Field(min_length=2, max_length=1000)
    ] = None
    """The same points typed in, `[[r, z], ...]`."""

    def profile(self):
        """Profile above the insert's height (m)."""
        return geometry.raised([[r / MM, z / MM] for r, z in self.points_mm], 0.0)


class Insert(Model):
    """The body in the hopper; `shape` picks one of the sections below it."""

    shape: Literal["cone", "double_cone", "bullet", "cone_in_cone", "profile", "none"] = "cone"
    """Which of the sections below counts; `none` is the bare hopper."""
    height_mm: Length = 29.6
    """Height of the insert's lowest point above the outlet."""
    cone: Cone = Cone()
    double_cone: DoubleCone = DoubleCone()
    bullet: Bullet = Bullet()
    cone_in_cone: ConeInCone = ConeInCone()
    profile: Profile = Profile()

    def polyline(self):
        """The insert's profile in its place (m), None for the bare hopper."""
        if self.shape == "none":
            return None
        return geometry.raised(getattr(self, self.shape).profile(), self.height_mm / MM)
