"""Words that people and programs name columns with, in the languages of common exports."""

import re

_JOINTS = ("j", "a", "q", "joint", "jnt", "rax", "axis", "achse", "gelenk", "theta", "θ", "ϑ", "ax",
           "axe", "articulation", "asse", "giunto", "eje", "关节", "轴", "関節", "軸")  # fmt: skip
_JOINT = f"(?:{'|'.join(_JOINTS)})"
JOINT = re.compile(rf"(?:.*[\s_])?{_JOINT}[\s_]*a?([1-9])")
FROM_ZERO = re.compile(rf"(.*?\b{_JOINT}[\s_]*a?)([0-9])")
"""The same, of programs that count joints from 0."""
OF_JOINTS = {"position", "positions", "pos", "angle", "angles", "value", "state", "states",
             "winkel", "wert", "angolo", "ángulo", "angulo"}  # fmt: skip
"""Words beside a joint that say nothing of which it is."""
JOINTS = (
    ("shoulder pan joint", "shoulder lift joint", "elbow joint", "wrist 1 joint", "wrist 2 joint",
     "wrist 3 joint"),
    ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"),
    ("s", "l", "u", "r", "b", "t"),
)  # fmt: skip
"""Joints 1 to 6 by names of makers, where all of them are there: Universal Robots, Yaskawa."""
PLACE = re.compile(r"(?:p|pos|tcp|pt)([xyz])")
"""A coordinate that is written in one word: Px, TCPx."""
OF_TARGET = re.compile(r"(.*?) ?([xyz]) ?(\d{0,3})")
"""A coordinate of one of several targets: x1, P1 x, SMR A x."""
BEHIND = re.compile(r"([xyz]) ([^\W\d].*)")
"""The same with the word behind: X raw."""
READ = {"read", "meas", "msr", "actual", "act", "feedback", "measured", "current", "ist", "istwert"}
"""Words of a joint that was read back."""
TARGETS = {"goal", "target", "nominal", "nom", "cmd", "command", "commanded", "ref", "set", "t",
           "soll", "sollwert", "reference", "desired", "programmed", "prog", "planned", "plan",
           "theo", "theoretical", "predicted", "expected", "calc", "calculated", "computed",
           "model", "cad", "sim", "simulated", "fk", "nominell", "nominale", "nominales",
           "théorique", "theorique", "consigne", "teorico", "teórico", "名义", "理论", "目标",
           "設計", "設計値", "目標"}  # fmt: skip
MEASURED = (
    {"meas", "measured", "mess", "messwert", "gemessen", "seen", "observed", "tracker", "laser",
     "lasertracker", "lt", "smr", "reflector", "prism", "mesuré", "mesurée", "mesure", "misurato",
     "misurata", "mean", "avg", "average", "mittel", "mittelwert", "moyenne", "media", "平均",
     "medido", "medida", "测量", "实测", "測定", "測定値", "実測", "実測値"},
    {"actual", "act", "ist", "istwert", "real", "true", "réel", "reel", "reale", "实际"},
)  # fmt: skip
"""Words of what an instrument saw: beside the first ones, the others are what a controller says."""
CONTROLLED = {"robot", "rob", "controller", "tcp", "flange"}
"""Words of what a controller says, where other columns do not say so."""
DIFFERENCES = {"dif", "diff", "difference", "delta", "δ", "err", "error", "dev", "deviation",
               "abw", "abweichung", "differenz", "écart", "ecart", "scostamento", "deviazione",
               "desviación", "desviacion", "偏差", "误差", "誤差"}  # fmt: skip
WISHED = TARGETS | DIFFERENCES
"""Words of a place that was not measured."""
DISTANCE = {"distance", "dist", "range", "length"}
"""Words of a distance from a fixed point, where no angle stands beside it."""
ANGLE = {"azimuth", "elevation", "zenith", "hz", "horizontal", "vertical"}
DRIVES = {"torque": "torque", "tau": "torque", "moment": "torque", "effort": "torque"}
"""Words of what a drive reports; a current is known by its unit, or as that of a motor."""
LOADS = {"payload", "load"}
SPREAD = {"std", "sd", "sigma", "stdev", "rms", "min", "max", "minimum", "maximum"}
EXPANDED = {"u95", "u95%", "unc95"}
STANDARD = {"u", "u1", "unc", "uncertainty"}
PLAIN = {
    "pose_id": {"pose", "poseid", "pose id", "pose nr", "pose no", "nr", "no", "id", "index",
                "number", "point", "point id", "pointid", "point name", "pointname", "name",
                "step order", "label", "punkt", "punktname", "nom", "punto", "nome", "名称"},
    "target": {"target", "reflector", "smr", "target name"},
    "station": {"station", "station name", "station id", "station nr", "station no", "instrument",
                "instrument name"},
    "anchor": {"anchor", "anchor name", "fixed point", "from", "nest", "ball", "base point"},
    "temperature_degC": {"temperature", "temp", "t air", "ambient temperature",
                         "measurement temperature"},
    "payload_kg": {"payload", "load"},
    "order": {"order", "sequence", "measuring order", "measured order"},
    "time": {"time", "timestamp", "time stamp", "date time", "datetime", "utc", "utc time",
             "local time", "measurement time", "zeit", "zeitstempel", "datum zeit",
             "datum uhrzeit", "horodatage", "date heure", "data ora", "fecha hora", "时间", "時刻"},
}  # fmt: skip
TURNS = {
    "rx": "rx", "ry": "ry", "rz": "rz", "roll": "rx", "pitch": "ry", "yaw": "rz",
    "qw": "qw", "qx": "qx", "qy": "qy", "qz": "qz", "q0": "qw",
}  # fmt: skip
QUATERNION = ("qw", "qx", "qy", "qz")
"""Of four numbers counted from 0, as q0, or from 1 beside joints of another name, as ABB does."""
SHIFTS = {"tx": "x", "ty": "y", "tz": "z"}
"""Beside turns Rx Ry Rz these are a place; alone they may be targets."""
OF_TURNS = {
    *TURNS.values(),
    *(f"r{i}{j}" for i in "123" for j in "123"),
    "rvx",
    "rvy",
    "rvz",
    "axis_x",
    "axis_y",
    "axis_z",
    "axis_angle",
}
LETTERS = ({"a": "rz", "b": "ry", "c": "rx"}, {"w": "rx", "p": "ry", "r": "rz"})
"""Turns of KUKA, about z, then y, then x, and of FANUC, about fixed x, y, z: they are the same."""
