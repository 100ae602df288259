"""The components of a sonar's state, with their units, symbols and names."""

from radarsim.language.translate import term
from radarsim.report.quantities import Component

COMPONENTS = (
    Component("r", "m", "$r$", term("range")),
    Component("vr", "m/s", "$v_r$", term("radial velocity")),
    Component("ar", "m/s2", "$a_r$", term("radial acceleration")),
    Component("b", "rad", "$\\beta$", term("bearing")),
    Component("vb", "rad/s", "$v_\\beta$", term("bearing rate")),
    Component("ab", "rad/s2", "$a_\\beta$", term("second rate of the bearing")),
    Component("x", "m", "$x$", term("distance north")),
    Component("vx", "m/s", "$v_x$", term("velocity north")),
    Component("ax", "m/s2", "$a_x$", term("acceleration north")),
    Component("y", "m", "$y$", term("distance east")),
    Component("vy", "m/s", "$v_y$", term("velocity east")),
    Component("ay", "m/s2", "$a_y$", term("acceleration east")),
    Component("d", "m", "$d$", term("depth")),
    Component("vd", "m/s", "$v_d$", term("rate of depth")),
    Component("ad", "m/s2", "$a_d$", term("second rate of depth")),
    Component("e", "rad", "$\\varepsilon$", term("elevation")),
    Component("ve", "rad/s", "$v_\\varepsilon$", term("rate of elevation")),
    Component("ae", "rad/s2", "$a_\\varepsilon$", term("second rate of elevation")),
)
COMPONENTS_BY_NAME = {component.name: component for component in COMPONENTS}
