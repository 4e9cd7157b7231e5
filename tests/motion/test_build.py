from roam_motion.session.build import build_name


def test_another_network_or_another_code_makes_another_build(tmp_path):
    (tmp_path / "step.py").write_text("a = b + c + d\n")
    first = build_name("weights", [tmp_path])
    assert build_name("weights", [tmp_path]) == first
    assert build_name("others", [tmp_path]) != first
    (tmp_path / "step.py").write_text("a = b + (c + d)\n")
    assert build_name("weights", [tmp_path]) != first
    assert build_name("weights") == build_name("weights")
