import pytest
from drawing import office

import mapmeld
from mapmeld.matching import METHODS, UnknownMethodError
from mapmeld.matching.alphabet import AlphabetParameters
from mapmeld.matching.baselines import AkazeMissingError


def test_an_unknown_method_is_named_beside_those_that_exist() -> None:
    with pytest.raises(UnknownMethodError, match=r"'fortune'.*alphabet"):
        mapmeld.match(office(), office(), method="fortune")


def test_parameters_of_another_method_are_refused() -> None:
    with pytest.raises(TypeError, match="AlphabetParameters"):
        mapmeld.match(office(), office(), method="alphabet", parameters={"corners": 30})


def test_parameters_reach_the_method() -> None:
    strict = AlphabetParameters(accept_similarity=1.0, corners=10)
    assert "threshold 1" in mapmeld.match(office(), office(0.1), method="alphabet", parameters=strict).reason


@pytest.mark.parametrize("name", METHODS)
def test_every_method_works_with_its_defaults(name: str) -> None:
    try:
        result = mapmeld.match(office(), office(), method=name)
    except AkazeMissingError as missing:
        pytest.skip(str(missing))
    assert result.method == name
    assert result.T_a_b is not None
    assert result.T_a_b.distance_to(mapmeld.Pose2()) == pytest.approx((0, 0), abs=0.1)
