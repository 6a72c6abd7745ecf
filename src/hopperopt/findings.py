"""What one simulation may not be, and what is only unusual about it.

Works on the attributes of a setup's models alone.
"""

import math
from typing import NamedTuple

from hopperopt import case as cases
from hopperopt import geometry, impact
from hopperopt.dem.materials import contact_law
from hopperopt.monitors import MAX_OVERLAP, MAX_SPEED_RATIO

MM = 1000.0
SMALLEST_GAP, USUAL_GAP = 2, 3  # coarse diameters between insert and wall
USUAL_OUTLET = 5, 200  # coarse diameters
MOST_PARTICLES = 10_000_000
SHORTEST_STEP, USUAL_STEP = 1e-4, 0.4  # Rayleigh times
# The scheme is stable at the paper's step for the paper's materials: those with at most its restitution and
# friction may take it without a warning.
TESTED = {"step": 0.78, "restitution": 0.7, "static_friction": 0.5}
USUAL_COMPRESSION, USUAL_SWING, USUAL_REBOUND = 0.25, 2.1, 1.7  # see hopperopt.impact
USUAL_SIZES = 2.5  # coarse over fine diameter
USUAL_EDGE = 20  # degrees: at a sharper one, 6 % of a sphere's radius into one face is in the other as well


class Finding(NamedTuple):
    """Something about one design: a key, its badness (the largest is told), and the words for it."""

    key: str
    kind: str
    badness: float
    text: str


def refusals(setup):
    """Sentences for what makes one simulation impossible; none when all is well."""
    return [sentence(finding) for finding in refused(setup)]


def sentence(finding, where=""):
    return f"{finding.key}: {finding.text}".replace("{where}", where)


def refused(setup):
    """Findings that make a simulation impossible. What does not fit a wrong hopper, or spheres of a wrong
    size, is no mistake of its own."""
    found = list(_hopper(setup)) or list(_filling(setup)) or list(_time_step(setup))
    yield from found
    yield from _sensor(setup)
    if setup.insert_profile is not None and not any(finding.key.startswith("hopper") for finding in found):
        yield from _insert(setup)


def _no(key, kind, badness, value, allowed):
    return Finding(key, kind, badness, f"{value}{{where}} is not allowed; allowed: {allowed}")


def _unit(value, low, high):
    """A question for a length (mm) that would lie between `low` and `high` if it were typed in metres."""
    return f" (in metres? {value:.4g} m is {value * MM:.4g} mm)" if low <= abs(value) * MM <= high else ""


def _hopper(setup):
    hopper, coarse = setup.hopper, setup.particles.diameters_mm[-1]
    if hopper.cylinder_radius_mm <= hopper.outlet_radius_mm:
        allowed = f"more than the outlet's radius, {hopper.outlet_radius_mm:g} mm"
        allowed += _unit(hopper.cylinder_radius_mm, hopper.outlet_radius_mm, MM)
        yield _no("hopper.cylinder_radius_mm", "narrow", 0, f"{hopper.cylinder_radius_mm:g}", allowed)
    if hopper.outlet_radius_mm < coarse / 2:
        allowed = f"at least the radius of the largest sphere, {coarse / 2:g} mm"
        allowed += _unit(hopper.outlet_radius_mm, coarse / 2, hopper.cylinder_radius_mm)
        yield _no("hopper.outlet_radius_mm", "small", 0, f"{hopper.outlet_radius_mm:g}", allowed)


def _filling(setup):
    level, coarse = setup.filling.level_mm, setup.particles.diameters_mm[-1]
    if level < coarse:
        allowed = f"at least a coarse diameter, {coarse:g} mm{_unit(level, coarse, MM)}"
        yield _no("filling.level_mm", "level", -level, f"{level:g}", allowed)
    if setup.particle_count > MOST_PARTICLES:
        count = f"filling with {setup.particle_count:.2g} particles"
        allowed = f"at most {MOST_PARTICLES:g}{_unit(coarse, 0, 2 * setup.hopper.outlet_radius_mm)}"
        yield _no("particles.diameters_mm", "count", setup.particle_count, count, allowed)


def _time_step(setup):
    rayleigh = setup.particles.rayleigh_time
    if setup.time_step > rayleigh:
        allowed = f"at most {rayleigh:.3g} (the smallest sphere's Rayleigh time, s), or auto (a fifth of it)"
        yield _no("simulation.time_step_s", "step", setup.time_step, f"{setup.time_step:g}", allowed)
    elif setup.time_step < SHORTEST_STEP * rayleigh:
        allowed = f"at least {SHORTEST_STEP * rayleigh:.3g} ({SHORTEST_STEP:g} Rayleigh times, s)"
        yield _no("simulation.time_step_s", "short", -setup.time_step, f"{setup.time_step:g}", allowed)


def _sensor(setup):
    """A sensor so deep that the run ends, as idle, before the first sphere that falls freely arrives."""
    fall = math.sqrt(2 * -setup.discharge.sensor_mm / MM / setup.simulation.gravity_m_s2)
    if (limit := setup.discharge.idle_limit_s) <= fall:
        allowed = f"more than {fall:.3g} (s, in which a sphere falls from the outlet to the sensor)"
        yield _no("discharge.idle_limit_s", "idle", fall, f"{limit:g}", allowed)


def _insert(setup):
    profile, coarse = setup.insert_profile, setup.particles.diameters[-1]
    key = f"insert.{setup.insert.shape}"
    if geometry.crosses_axis(profile):
        yield _no(key, "axis", 0, "a profile that crosses the axis", "r above 0, and 0 only at its ends")
        return
    if geometry.crosses_itself(profile):
        yield _no(key, "crossing", 0, "a profile that crosses or touches itself", "a simple line")
        return
    thickness, least = setup.insert.cone_in_cone.thickness_mm, 2 * MAX_OVERLAP * coarse / 2 * MM
    if setup.insert.shape == "cone_in_cone" and thickness < least:
        allowed = f"at least {least:g} mm (spheres on either side of a thinner sheet may feel each other)"
        yield _no(f"{key}.thickness_mm", "sheet", -thickness, f"{thickness:g}", allowed)
    if (inner := geometry.inner_radius(profile)) < coarse / 2:
        value = f"a face that looks inwards on a circle of radius {inner * MM:.3g} mm"
        yield _no(key, "hollow", -inner, value, f"no smaller than the largest sphere, {coarse / 2 * MM:g} mm")
    elif 0 < (width := 2 * geometry.opening_radius(profile)) < SMALLEST_GAP * coarse:
        value = f"an opening of {width * MM:.3g} mm through the insert"
        yield _no(key, "opening", -width, value, _passage(coarse))
    gap = setup.wall_gap
    if gap < SMALLEST_GAP * coarse:
        value = "an insert that touches the wall or lies beyond it"
        if gap > 0:
            value = f"a gap of {gap * MM:.3g} mm between insert and wall"
        allowed = f"a gap of {_passage(coarse)}"
        allowed += _unit(setup.insert.height_mm, coarse * MM, setup.filling.level_mm)
        yield _no("insert", "gap", -gap, value, allowed)


def _passage(coarse):
    return f"at least {SMALLEST_GAP * coarse * MM:g} mm ({SMALLEST_GAP} coarse diameters)"


def unusual(setup):
    """Findings that a simulation can live with."""
    coarse, hopper = setup.particles.diameters[-1], setup.hopper
    width, (least, most) = 2 * hopper.outlet_radius_mm / MM / coarse, USUAL_OUTLET
    if width < least:
        text = f"an outlet of {width:.3g} coarse diameters{{where}} may jam; usual: {least} or more"
        yield Finding("hopper.outlet_radius_mm", "outlet", -width, text)
    elif width > most:
        text = (
            f"an outlet of {width:.3g} coarse diameters{{where}}; usual: at most {most} (all lengths in mm)"
        )
        yield Finding("hopper.outlet_radius_mm", "wide", width, text)
    depth = -setup.discharge.sensor_mm / MM
    if depth < coarse / 2:
        text = f"{-depth * MM:g}{{where}} is less than a coarse radius below the outlet"
        text += _unit(depth * MM, coarse / 2 * MM, MM)
        yield Finding("discharge.sensor_mm", "sensor", -depth, text)
    share = setup.time_step / setup.particles.rayleigh_time
    if share > USUAL_STEP and not tested(setup, share):
        text = f"{share:.2f} Rayleigh times{{where}}: an impact may gain energy; usual: at most {USUAL_STEP}"
        yield Finding("simulation.time_step_s", "step", share, text)
    yield from _hard_impacts(setup)
    profile = setup.insert_profile
    if profile is None:
        return
    if (gap := setup.wall_gap) < USUAL_GAP * coarse:
        text = (
            f"a gap to the wall of {gap / coarse:.2f} coarse diameters{{where}}; usual: {USUAL_GAP} or more"
        )
        yield Finding("insert", "gap", -gap, text)
    if 0 < (width := 2 * geometry.opening_radius(profile)) < least * coarse:
        text = f"an opening through it of {width / coarse:.3g} coarse diameters{{where}} may jam"
        yield Finding(f"insert.{setup.insert.shape}", "opening", -width, f"{text}; usual: {least} or more")
    if not geometry.is_solid(profile):
        text = "a shell without thickness{where}: spheres on its two sides feel each other"
        text += "; usual: a line that closes, or that has both ends on the axis"
        yield Finding(f"insert.{setup.insert.shape}", "shell", 0, text)
    if (width := float(profile[:, 0].max())) < coarse / 2:
        text = f"its radius, {width * MM:.3g} mm{{where}}, is less than a coarse sphere's"
        text += _unit(width * MM, coarse / 2 * MM, setup.hopper.cylinder_radius_mm)
        yield Finding(f"insert.{setup.insert.shape}", "thin", -width, text)
    if (edge := geometry.sharpest_edge(profile)) < USUAL_EDGE:
        text = f"an edge of {edge:.3g} degrees{{where}}: a sphere pressed on one of its faces feels both"
        yield Finding(f"insert.{setup.insert.shape}", "edge", -edge, f"{text}; usual: {USUAL_EDGE} or more")
    apex, level = float(profile[:, 1].max()) * MM, setup.filling.level_mm
    if apex > level:
        text = f"its top, at {apex:.3g} mm, stands above the bed's surface, at {level:g} mm{{where}}"
        yield Finding("insert", "apex", apex - level, text)
    yield from _resting(setup, profile)


def _resting(setup, profile):
    """An upper face so flat that rolling friction holds particles on it, for ever."""
    friction = 0 if setup.contact.rolling == "none" else setup.contact.wall.rolling_friction
    slope, least = geometry.shallowest_upper_face(profile), math.degrees(math.atan(friction))
    if slope < least:
        text = (
            f"an upper face of {slope:.3g} degrees{{where}}: particles rest on it; "
            f"usual: more than {least:.3g} (the angle of the wall's rolling friction)"
        )
        yield Finding(f"insert.{setup.insert.shape}", "flat", -slope, text)


def _hard_impacts(setup):
    """Impacts that may break the monitors of overlap and speed."""
    spheres, contact = setup.particles, setup.contact
    fine, _, coarse = spheres.diameters
    sphere = (spheres.shear_modulus_pa, spheres.poisson_ratio)
    others = (sphere, (setup.wall.shear_modulus_pa, setup.wall.poisson_ratio))
    moduli = [contact_law(sphere, other, 1, 0, 0).modulus for other in others]
    speed = _fall_speed(setup)
    compression = impact.compression(fine, coarse, spheres.density_kg_m3, min(moduli), speed)
    if compression > USUAL_COMPRESSION:
        text = (
            f"a coarse sphere that falls at {speed:.2g} m/s may compress a fine one by {compression:.2f} of "
            f"its radius{{where}}; usual: at most {USUAL_COMPRESSION} "
            f"(a run that exceeds {MAX_OVERLAP} is refused)"
        )
        yield Finding("particles.shear_modulus_pa", "soft", compression, text)
    swing = impact.swing(fine, coarse, spheres.density_kg_m3, moduli, compression, setup.time_step)
    if swing > USUAL_SWING:
        text = (
            f"too long for a fine sphere squeezed by a coarse one, whose angular frequency times the step is "
            f"{swing:.2f}{{where}}; usual: at most {USUAL_SWING}"
        )
        yield Finding("simulation.time_step_s", "swing", swing, text)
    if coarse > USUAL_SIZES * fine:
        text = f"1 : {coarse / fine:.3g}{{where}}: fine spheres may be flung off"
        text += f"; usual: at most 1 : {USUAL_SIZES} (a run with one at twice the speed of fall is refused)"
        yield Finding("particles.diameters_mm", "sizes", coarse / fine, text)
    elastic = contact.particle.restitution > 0.8 and coarse > 1.5 * fine  # many hits of coarse ones add up
    rebound = impact.rebound(spheres.diameters, contact.particle.restitution, contact.wall.restitution)
    if rebound > USUAL_REBOUND or elastic:
        text = (
            f"{contact.particle.restitution:g}{{where}}: fine spheres may rebound from coarse ones at "
            f"{rebound:.2f} times the speed of free fall, or more after several hits; usual: at most "
            f"{USUAL_REBOUND} and a restitution of 0.8 (a run that exceeds {MAX_SPEED_RATIO:g} is refused)"
        )
        yield Finding("contact.particle.restitution", "rebound", rebound, text)


def _fall_speed(setup):
    """Speed (m/s) of a fast sphere that falls from the column's top to the outlet."""
    start = setup.filling.speed_m_s + 3 * setup.filling.speed_scatter_m_s
    return math.sqrt(start**2 + 2 * setup.simulation.gravity_m_s2 * cases.column_top(setup))


def tested(setup, share):
    contacts = (setup.contact.particle, setup.contact.wall)
    return share <= TESTED["step"] and all(
        contact.restitution <= TESTED["restitution"] and contact.static_friction <= TESTED["static_friction"]
        for contact in contacts
    )
