"""Words of every report that states a tool point, explained once."""

GLOSSARY = (
    "u: standard uncertainty. Of a point it is 3-D: the root of the summed variances along x, y "
    "and z, k = 1; a ball of that radius holds about 61 % of a round distribution.",
    "U = 2 u of a single number holds it with 95.4 %. In three dimensions the ellipsoid of k = 2 "
    "would hold 73.9 %, so that no U of a point is stated by k alone.",
    "R95, 3-D radius: distance from the predicted point within which the true one lies with 95 % "
    "probability, at poses drawn like the held-out ones. It is 1.61 u of a round region, 1.96 u of "
    "a line.",
    "Region: an ellipsoid at each pose that holds the point with 95 % probability; its semi-axes "
    "are k standard deviations, k = 2.80 in three dimensions (2.45 in two, 1.96 in one).",
    "Guard: 19 held-out poses or more, whose errors may raise k, so that region and radius would "
    "each have held 95 % of them.",
    "Misfit: what the robot does and no number of the model can follow, per axis, after the best "
    "fit. Below the size that would have been seen it hides behind the noise, and is in the "
    "region up to its limit.",
    "Mean of many moves, one move: a robot that is sent to a pose again and again scatters about a "
    "mean. The first statement is of that mean, the second of where one of these moves ends.",
    "Transfer g: how much of what the model leaves out reaches a target, as against the held-out "
    "poses; leverage h: the same of the noise. The region grows with g; above 9 there is none.",
)
