"""What certificates of families hold and say, and what they refuse."""

from __future__ import annotations

import time

import pytest

from ptcc_certify import NominalProtocol
from ptcc_certify.certificate.family_certificate import certify_family
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)


def test_more_modes_than_a_certificate_holds_are_refused_before_any_work():
    one = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)]).modes[0]
    many = Family((one,) * 1001)
    start = time.process_time()
    with pytest.raises(ParameterError, match="1,001 modes, and a certificate holds 1,000 at most; put modes"):
        certify_family(many, PROTOCOL)
    assert time.process_time() - start < 0.5
    assert decide(many)[0].behaviour == "bipartite consensus"
