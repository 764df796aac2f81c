"""Words in names of columns by people and programs, in the languages of common exports."""

import re

_JOINTS = ("j", "a", "q", "joint", "jnt", "rax", "axis", "achse", "gelenk", "theta", "θ", "ϑ", "ax",
           "axe", "articulation", "asse", "giunto", "eje", "关节", "轴", "関節", "軸")  # fmt: skip
_JOINT = f"(?:{'|'.join(_JOINTS)})"
JOINT = re.compile(rf"(?:.*[\s_])?{_JOINT}[\s_]*a?([1-9])")
FROM_ZERO = re.compile(rf"(.*?\b{_JOINT}[\s_]*a?)([0-9])")
"""The same, of programs that count joints from 0."""
OF_JOINTS = {"position", "positions", "pos", "angle", "angles", "value", "state", "states",
             "winkel", "wert", "angolo", "ángulo", "angulo"}  # fmt: skip
"""Words beside a joint that do not identify it."""
JOINTS = (
    ("shoulder pan joint", "shoulder lift joint", "elbow joint", "wrist 1 joint", "wrist 2 joint",
     "wrist 3 joint"),
    ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"),
    ("s", "l", "u", "r", "b", "t"),
)  # fmt: skip
"""Joints 1 to 6 by names of makers, used if all of them exist: Universal Robots, Yaskawa."""
PLACE = re.compile(r"(?:p|pos|tcp|pt)([xyz])")
"""A coordinate written as one word: Px, TCPx."""
ROTATIONS = {"rot", "rotation", "rotations", "euler", "angle", "angles", "rvec", "rotvec", "rv",
             "rpy", "theta", "phi", "orientation", "winkel", "drehung", "rotazione", "rotación",
             "rotacion"}  # fmt: skip
"""Words that make a letter of an axis a turn about it: Rot X."""
TURN = re.compile(rf"(?:{'|'.join(sorted(ROTATIONS, reverse=True))})([xyz])")
"""The same written as one word: RotationX."""
OF_TARGET = re.compile(r"(.*?) ?([xyz]) ?(\d{0,3})")
"""A coordinate of one of several targets: x1, P1 x, SMR A x."""
BEHIND = re.compile(r"([xyz]) ([^\W\d].*)")
"""The same with the word after it: X raw."""
READ = {"read", "meas", "msr", "actual", "act", "feedback", "measured", "current", "ist", "istwert"}
"""Words for a joint value that was read back."""
MOVING = {"velocity", "velocities", "vel", "qd", "dq", "speed", "speeds", "acceleration",
          "accelerations", "acc", "qdd", "ddq"}  # fmt: skip
"""Words for how fast a joint moves, which is no place of it."""
RATES = MOVING | {
    "effort", "efforts", "torque", "torques", "tau", "current", "currents", "moment",
    "temperature", "temp", "error", "err", "gain", "voltage",
}  # fmt: skip
"""Words for what joints have besides their position."""
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
"""Words for measured values; beside the first ones, the others are values of a controller."""
CONTROLLED = {"robot", "rob", "controller", "tcp", "flange"}
"""Words for values of a controller, if other columns do not have them."""
DIFFERENCES = {"dif", "diff", "difference", "delta", "δ", "err", "error", "dev", "deviation",
               "abw", "abweichung", "differenz", "écart", "ecart", "scostamento", "deviazione",
               "desviación", "desviacion", "偏差", "误差", "誤差"}  # fmt: skip
WISHED = TARGETS | DIFFERENCES
"""Words for a position that was not measured."""
DISTANCE = {"distance", "dist", "range", "length"}
"""Words for a distance from a fixed point, if there is no angle beside it."""
ANGLE = {"azimuth", "elevation", "zenith", "hz", "horizontal", "vertical"}
DRIVES = {"torque": "torque", "tau": "torque", "moment": "torque", "effort": "torque"}
"""Words for quantities that a drive reports; a current is known by its unit, or the word motor."""
LOADS = {"payload", "load"}
SPREAD = {"std", "sd", "sigma", "stdev", "rms", "min", "max", "minimum", "maximum", "mpe", "tol",
          "tolerance"}  # fmt: skip
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
             "local time", "measurement time", "time of day", "clock", "zeit", "uhrzeit",
             "zeitstempel", "datum zeit", "datum uhrzeit", "horodatage", "date heure",
             "data ora", "fecha hora", "时间", "時刻"},
}  # fmt: skip
TURNS = {
    "rx": "rx", "ry": "ry", "rz": "rz", "roll": "rx", "pitch": "ry", "yaw": "rz",
    "qw": "qw", "qx": "qx", "qy": "qy", "qz": "qz", "q0": "qw",
}  # fmt: skip
QUATERNION = ("qw", "qx", "qy", "qz")
"""Names of four numbers counted from 0, as q0, or from 1 beside joints of another name (ABB)."""
COUNTED = re.compile(r"(q|quat|quaternion|rot quat|orientation|orient) ?([0-4])")
"""One of four numbers that are counted."""
OF_TURNS = {
    *TURNS.values(),
    *(f"r{i}{j}" for i in "123" for j in "123"),
    "e1",
    "e2",
    "e3",
    "rvx",
    "rvy",
    "rvz",
    "axis_x",
    "axis_y",
    "axis_z",
    "axis_angle",
}
LETTERS = (
    {"a": "rz", "b": "ry", "c": "rx"},
    {"w": "rx", "p": "ry", "r": "rz"},
    {"o": "e1", "a": "e2", "t": "e3"},
    {"a": "e1", "e": "e2", "r": "e3"},
    {"alpha": "rx", "beta": "ry", "gamma": "rz"},
    {"α": "rx", "β": "ry", "γ": "rz"},
    {"phi": "rx", "theta": "ry", "psi": "rz"},
)
"""Equal rotations: of KUKA, about z, then y, then x, and of FANUC, about fixed x, y, z; those of
Kawasaki and Comau, about z, the turned y and the turned z. Greek letters are of books."""
