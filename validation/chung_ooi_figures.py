"""Figures of the `chung_ooi` case, and the points of the literature that they show.

Read off figures of Chung and Ooi, Granular Matter 13 (2011) 643: aluminium oxide (T4), steel (T5) and the
aluminium alloy (T6 and T8).
"""

import matplotlib.pyplot as plt
import numpy as np

OURS, CONTINUOUS, CLOSED, LITERATURE = "#0072B2", "#009E73", "black", "#D55E00"

T4 = np.array([  # angle (deg), tangential restitution, spin (rad/s), rebound angle of the surface (deg)
    (5, 0.948, -19, 3.8), (10, 0.687, -213, -1.6), (15, 0.624, -378, -5.5), (20, 0.616, -511, -7.5),
    (25, 0.634, -599, -7.5), (30, 0.684, -617, -3.5), (35, 0.737, -582, 3.4), (40, 0.781, -545, 11.6),
    (50, 0.845, -457, 29.4), (60, 0.893, -357, 47.8), (70, 0.932, -246, 64.6), (80, 0.966, -126, 78.7),
    (85, 0.983, -63, 84.5),
])  # fmt: skip
T5 = np.array([  # x, surface velocity, R spin, both over mu v_n
    (0.06, -0.08, -0.11), (0.34, -0.28, -0.43), (0.67, -0.49, -0.82), (1.0, -0.75, -1.25),
    (1.34, -1.0, -1.66), (1.67, -1.27, -2.09), (2.0, -1.53, -2.52), (2.34, -1.81, -2.98), (2.99, -2.44, -3.9),
    (3.33, -2.69, -4.29), (4.0, -2.79, -4.84), (5.0, -2.0, -5.01), (6.0, -1.01, -5.01), (10.0, 3.01, -5.0),
])  # fmt: skip
T6_T8 = np.array([  # x, beta of T6, beta of T8
    (0.18, -0.82, -0.815), (0.355, -0.633, -0.626), (0.55, -0.445, -0.439), (0.77, -0.243, -0.238),
    (0.97, -0.028, -0.017), (1.2, 0.097, 0.096), (1.47, 0.119, 0.111), (1.755, 0.1, 0.09),
    (2.09, 0.058, 0.058), (2.5, 0.005, 0.006), (2.99, -0.05, -0.049), (3.63, -0.1, -0.103),
    (4.51, -0.14, -0.139), (5.76, -0.175, -0.162),
    (7.83, -0.208, -0.204), (11.9, -0.258, -0.248), (24.0, -0.342, -0.318),
])  # fmt: skip


def panel(axes, x, solver, ode, sliding, points):
    """One quantity: the solver, the continuous law, the closed form (x, y) and the literature (x, y)."""
    axes.plot(x, ode, color=CONTINUOUS, lw=2)
    axes.plot(*sliding, "--", color=CLOSED, lw=1)
    axes.plot(*points, "s", mfc="none", color=LITERATURE, ms=5)
    axes.plot(x, solver, ".", color=OURS, ms=5)
    axes.grid(color="0.9")
    axes.spines[["top", "right"]].set_visible(False)


def key(axes, x, y, step):
    """Names of the four in their colours, from (x, y) in axes coordinates downwards."""
    names = (
        "dots: the solver",
        "line: same law, ODE",
        "dashes: closed form, sliding",
        "squares: Chung and Ooi",
    )
    for k, (name, colour) in enumerate(zip(names, (OURS, CONTINUOUS, CLOSED, LITERATURE), strict=True)):
        axes.text(x, y - k * step, name, color=colour, transform=axes.transAxes, fontsize=9, va="top")


def draw_t4(path, t4, angles):
    """Tangential restitution, spin and rebound angle over the angle of impact."""
    mu, e, speed, radius = 0.092, 0.98, 3.9, 0.0025
    radians = np.radians(angles)
    wide = np.linspace(35.0, 88.0, 50)
    cos, tan = np.cos(np.radians(wide)), np.tan(np.radians(wide))
    figure, (one, two, three) = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    coming = speed * np.sin(radians)
    panel(one, angles, t4.tangential / coming, t4.reference[0] / coming,
          (wide, 1.0 - mu * (1.0 + e) / tan), T4[:, [0, 1]].T)  # fmt: skip
    one.set_ylabel("tangential velocity, after / before")
    key(three, 0.04, 0.98, 0.085)
    panel(two, angles, -t4.rolling[:, 0] / radius, -t4.reference[2][:, 0] / radius,
          (wide, -2.5 * mu * (1.0 + e) * speed * cos / radius), T4[:, [0, 2]].T)  # fmt: skip
    two.set_ylabel("spin after impact (rad/s)")
    rebound, ode = (
        np.degrees(np.arctan2(slip, normal))
        for slip, normal in ((t4.slip, t4.normal), (t4.reference_slip, t4.reference[1]))
    )
    sliding = np.degrees(np.arctan((tan - 3.5 * mu * (1.0 + e)) / e))
    panel(three, angles, rebound, ode, (wide, sliding), T4[:, [0, 3]].T)
    three.set_ylabel("rebound angle of the surface (°)")
    for axes in (one, two, three):
        axes.set_xlabel("angle of impact from the normal (°)")
        axes.set_xlim(0, 90)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def draw_t5(path, t5, x):
    """Surface velocity and spin over the slip before the impact."""
    unit = 0.3 * 5.0
    wide = np.array([7.0, 14.0])
    figure, (one, two) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    panel(one, x, t5.slip / unit, t5.reference_slip / unit, (wide, wide - 7.0), T5[:, [0, 1]].T)
    one.set_ylabel(r"surface velocity after, $v_{st}'/(\mu v_n)$")
    one.set_ylim(-4, 7.5)
    key(one, 0.04, 0.98, 0.08)
    panel(
        two, x, -t5.rolling[:, 0] / unit, -t5.reference[2][:, 0] / unit, (wide, [-5.0, -5.0]), T5[:, [0, 2]].T
    )
    two.set_ylabel(r"spin after, $R\omega'/(\mu v_n)$")
    for axes in (one, two):
        axes.set_xlabel(r"surface velocity before, $x = v_{st}/(\mu v_n)$")
        axes.set_xlim(0, 14)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def draw_t6_t8(path, t6, t8, x):
    """Restitution of the surface velocity over the inverse of the spin."""
    figure, both = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained", sharey=True)
    surface = 3.5 * 0.4 * 1.5 * 0.2 / x
    wide = np.linspace(0.13, 0.9, 50)
    titles = ("T6: on a rigid plane", "T8: on a sphere five times as large")
    for axes, curve, column, title in zip(both, (t6, t8), (1, 2), titles, strict=True):
        panel(
            axes,
            x,
            -curve.slip / surface,
            -curve.reference_slip / surface,
            (wide, wide - 1.0),
            T6_T8[:, [0, column]].T,
        )
        axes.set_xscale("log")
        axes.set_xticks([0.2, 0.5, 1, 2, 5, 10, 20], ["0.2", "0.5", "1", "2", "5", "10", "20"])
        axes.minorticks_off()
        axes.set_xlabel(r"$x = 3.5\,\mu(1+e)\,v_n/v_{st}$")
        axes.set_title(title, fontsize=10)
    both[0].set_ylabel(r"surface restitution $\beta = -v_{st}'/v_{st}$")
    key(both[0], 0.42, 0.36, 0.08)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def draw(folder, t4, t5, t6, t8, angles, slip_ratios, spin_ratios):
    """The three figures, into `folder`."""
    draw_t4(folder / "chung_ooi_t4.png", t4, angles)
    draw_t5(folder / "chung_ooi_t5.png", t5, slip_ratios)
    draw_t6_t8(folder / "chung_ooi_t6_t8.png", t6, t8, spin_ratios)
