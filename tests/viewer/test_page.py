"""The demo page in a real browser, over the real routes: what a person would see.

One page for all tests, because loading it is most of their cost; each test brings it to where it starts.
"""

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.timeout(600)

SIT = 3
ROOT = Path(__file__).parents[2]
CHAIR = ROOT / "examples/objects/chair.glb"
AXE = [
    Path(folder) / "axe-core/axe.min.js"
    for folder in (ROOT / "node_modules", os.environ.get("ROAM_TEST_NODE_MODULES", ""))
    if folder
]


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
    # nothing else changed: the object is still named, and everything can be used
    assert page.eval_on_selector("#objects", "e => e.selectedOptions[0].text") == "chair"
    assert page.is_enabled("#sit")
    assert page.is_enabled("#restart")
    assert page.is_enabled("#pause")
    # the browser itself logs the refused requests
    page.complaints[:] = [text for text in page.complaints if "status of 4" not in text]


def test_a_file_of_ones_own_is_named_in_the_selector(page: Any):
    restart(page)
    page.set_input_files("#file", [str(CHAIR.with_name("stool.glb"))])
    wait(page, "() => document.getElementById('objects').selectedOptions[0].text === 'stool.glb'")
    wait(page, "() => window.roam.phase === 'walking to the goal' && window.roam.frames > 3")
    page.select_option("#objects", label="chair")
    wait(page, "() => document.getElementById('object-note').innerText.startsWith('56 × 101')")
    wait(page, "() => window.roam.phase === 'walking to the goal' && window.roam.frames > 3")


def test_the_keyboard_alone_gets_past_every_control(page: Any):
    restart(page)
    page.focus("#objects")
    seen = []
    for _ in range(14):
        page.keyboard.press("Tab")
        seen.append(page.evaluate("() => document.activeElement.id"))
    assert {"upload", "sit", "lie", "stand", "restart", "pause", "timeline", "save-format", "save"} <= set(seen)
    page.focus("#upload")
    with page.expect_file_chooser():
        page.keyboard.press("Enter")


def test_the_timeline_shows_what_was_and_comes_back(page: Any):
    restart(page)
    wait(page, "() => window.roam.frames > 20")
    page.eval_on_selector("#timeline", "e => { e.value = 0.1; e.dispatchEvent(new Event('input')); }")
    wait(page, "() => document.getElementById('timeline-note').innerText.startsWith('0.1 s of')")
    page.eval_on_selector("#timeline", "e => { e.value = e.max; e.dispatchEvent(new Event('input')); }")
    wait(page, "() => document.getElementById('timeline-note').innerText === 'live'")


@pytest.mark.parametrize(("format", "start"), [("glb", b"glTF"), ("bvh", b"HIERARCHY"), ("png", b"\x89PNG")])
def test_what_is_shown_can_be_saved(page: Any, format: str, start: bytes):
    wait(page, "() => !document.getElementById('save').disabled && window.roam.frames > 3")
    page.select_option("#save-format", format)
    with page.expect_download() as waiting:
        page.click("#save")
    assert Path(waiting.value.path()).read_bytes().startswith(start)
    assert waiting.value.suggested_filename == f"sit.{format}"


def test_a_telephone_shows_every_control(page: Any):
    restart(page)
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
    for name in ("hud", "panel"):
        box = page.locator(f"#{name}").bounding_box()
        assert min(box["x"], box["y"]) >= 0
        assert box["x"] + box["width"] <= 390
        assert box["y"] + box["height"] <= 844
    for name in ("upload", "sit", "lie", "restart", "pause", "timeline", "save"):
        page.locator(f"#{name}").scroll_into_view_if_needed()
        box = page.locator(f"#{name}").bounding_box()
        assert min(box["x"], box["y"]) >= 0
        assert box["x"] + box["width"] <= 390
        assert box["y"] + box["height"] <= 844
    page.set_viewport_size({"width": 860, "height": 480})


def test_the_accessibility_rules_of_wcag_hold(page: Any):
    script = next((f for f in AXE if f.is_file()), None)
    if script is None:
        pytest.skip("needs the npm package axe-core (npm ci, or ROAM_TEST_NODE_MODULES)")
    restart(page)
    page.evaluate(script.read_text())
    tags = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
    found = page.evaluate("(tags) => axe.run({ runOnly: tags })", tags)
    assert [(v["id"], [n["html"] for n in v["nodes"]]) for v in found["violations"]] == []
    assert len(found["passes"]) > 10
