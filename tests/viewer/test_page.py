"""The demo page in a real browser, over the real routes: what a person would see.

One page for all tests, because loading it is most of their cost; each test brings it to where it starts.
"""

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.timeout(600)

SIT = 3


def wait(page: Any, condition: str) -> None:
    page.wait_for_function(condition, timeout=300_000)


def restart(page: Any) -> None:
    """A session of its own, whose character is at its start and has begun to walk."""
    wait(page, "() => !document.getElementById('restart').disabled && window.roam.session")
    before = page.evaluate("() => window.roam.session")
    page.click("#restart")
    wait(page, f"() => window.roam.session && window.roam.session !== '{before}'")
    wait(page, "() => window.roam.frames > 3 && window.roam.frames < 60 && window.roam.goalDistance > 1.5")


def picture(page: Any) -> np.ndarray:
    """The 3D view, panel and HUD cut away, after two more drawn frames. [H, W, 3] in 0..255."""
    drawn = page.evaluate("() => window.roam.drawn")
    wait(page, f"() => window.roam.drawn >= {drawn + 2}")
    shot = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), np.int16)
    return shot[:400, 320:]


def test_the_character_is_in_the_picture(page: Any):
    restart(page)
    page.click("#pause")
    page.uncheck("#ghost")
    page.uncheck("#follow")  # or the room moves behind the character
    page.evaluate("() => window.roam.hideCharacter(true)")
    empty = picture(page)
    page.evaluate("() => window.roam.hideCharacter(false)")
    shown = picture(page)
    page.check("#ghost")
    page.check("#follow")
    # the room itself: furniture against floor against backdrop
    assert empty.reshape(-1, 3).std(axis=0).max() > 8
    rows, columns = np.nonzero(np.abs(shown - empty).max(axis=-1) > 24)
    assert len(rows) > 1000
    height, width = np.ptp(np.percentile(rows, [1, 99])), np.ptp(np.percentile(columns, [1, 99]))
    assert height > 80
    assert height > 1.2 * width  # somebody upright, not a smear
    # shirt and trousers: a body in clothes, not a silhouette of one colour
    body = shown[rows, columns]
    assert (body.max(axis=-1) < 90).sum() > 100
    assert ((body[:, 2] - body[:, 0]) > 25).sum() > 100


def test_the_numbers_are_on_the_page(page: Any):
    restart(page)
    assert "hips to seat 1.0 cm" in page.inner_text("#pose-note")
    assert "56 × 101 × 63 cm" in page.inner_text("#object-note")
    assert page.inner_text("#hud-action") in ("idle", "walk", "sit")
    assert page.inner_text("#hud-distance").endswith((" m", " cm"))


def test_the_curve_of_the_energy_is_drawn(page: Any):
    wait(page, "() => !document.getElementById('restart').disabled")
    page.select_option("#objects", label="stool")
    wait(page, "() => !document.getElementById('object-note').innerText.startsWith('56 × 101')")
    wait(page, "() => window.roam.phase === 'walking to the goal' && window.roam.frames > 3")
    curve = page.evaluate(
        "() => document.getElementById('energy').getContext('2d').getImageData(0, 0, 520, 120).data.some((v) => v > 0)"
    )
    assert curve
    page.select_option("#objects", label="chair")
    wait(page, "() => document.getElementById('object-note').innerText.startsWith('56 × 101')")


def test_the_character_sits_down_and_stands_up_again(page: Any):
    restart(page)
    wait(page, f"() => window.roam.action === {SIT} && window.roam.goalDistance < 0.15")
    page.click("#stand")
    wait(page, "() => window.roam.phase === 'standing'")


def test_keys_and_clicks_on_the_floor_steer(page: Any):
    restart(page)
    page.locator("#stage").focus()
    before = np.array(page.evaluate("() => window.roam.hips"))
    page.keyboard.down("KeyA")
    wait(page, "() => window.roam.phase === 'steered by hand'")
    frames = page.evaluate("() => window.roam.frames")
    wait(page, f"() => window.roam.frames > {frames + 30}")
    page.keyboard.up("KeyA")
    wait(page, "() => window.roam.phase === 'standing'")
    after = np.array(page.evaluate("() => window.roam.hips"))
    assert np.linalg.norm((after - before)[[0, 2]]) > 0.2
    page.mouse.click(520, 400)
    wait(page, "() => window.roam.phase === 'steered by hand'")


def test_space_pauses_and_goes_on(page: Any):
    restart(page)
    page.locator("#stage").focus()
    page.keyboard.press("Space")
    assert page.get_attribute("#pause", "aria-pressed") == "true"
    page.wait_for_timeout(2000)
    frames = page.evaluate("() => window.roam.frames")
    page.wait_for_timeout(1000)
    assert page.evaluate("() => window.roam.frames") == frames
    page.keyboard.press("Space")
    wait(page, f"() => window.roam.frames > {frames + 5}")


def test_a_file_that_is_no_furniture_is_answered_in_words(page: Any):
    restart(page)
    broken = {"name": "chair.glb", "mimeType": "model/gltf-binary", "buffer": b"this is not a mesh"}
    page.set_input_files("#file", [broken])
    page.wait_for_selector("#error:not([hidden])")
    assert len(page.inner_text("#error span")) > 20
    # the browser itself logs the refused requests
    page.complaints[:] = [text for text in page.complaints if "status of 4" not in text]
