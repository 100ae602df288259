"""What the paper claims, as data. Yours: a claim for each statement that a run can judge.

A claim says where the paper says what, how it was read, and in parts what is measured and which values its words leave.
Write the ranges down from the words alone, before anything is measured.
"""

from radarsim.report.claims import Claim, Part, above

from random_walk.measures import last_gain

CLAIMS = (
    Claim(
        id="random_walk.1",  # the part before the point is the paper's key
        place="section 1",
        statement="The Kalman filter's error is more than 10 % below that of the fixed gain",
        parts=(Part(("walk",), "gain in σ at the last scan", "%", last_gain, above(10)),),
        reading="of the root-mean-square error at the last scan",
        config="random_walk",  # the shipped config that judges it
    ),
)
