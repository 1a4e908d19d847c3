import types
from typing import Any

import pytest
from drawing import drawn

from mapmeld.errors import MapmeldError
from mapmeld.matching.baselines import FeatureAkazeParameters, feature_akaze, match_feature_akaze


def test_an_opencv_without_akaze_is_one_line_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feature_akaze, "cv2", types.SimpleNamespace())
    with pytest.raises(MapmeldError) as caught:
        match_feature_akaze(drawn("."), drawn("."))
    message = str(caught.value)
    assert "pip install opencv-contrib-python-headless" in message
    assert "\n" not in message


@pytest.mark.parametrize("extra_module", [False, True])
def test_akaze_is_looked_for_where_either_opencv_keeps_it(
    monkeypatch: pytest.MonkeyPatch, extra_module: bool
) -> None:
    home = types.SimpleNamespace(AKAZE_create=lambda threshold: threshold)
    fake = types.SimpleNamespace(xfeatures2d=home) if extra_module else home
    monkeypatch.setattr(feature_akaze, "cv2", fake)
    assert feature_akaze._akaze(0.25) == 0.25


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_values_out_of_range_are_named(value: Any) -> None:
    with pytest.raises(ValueError, match="response"):
        FeatureAkazeParameters(response=value)
    with pytest.raises(ValueError, match="match_conf"):
        FeatureAkazeParameters(match_conf=2.0)
