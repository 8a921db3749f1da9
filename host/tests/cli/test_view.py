"""`colonnade view`: its address stands alone, and a camera is saved in a file that is the user's."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

CAMERA = json.dumps({"position": [0, 1, 12], "target": [0, 0, 0]}).encode()


@pytest.mark.parametrize(("scene", "is_own"), [("first-light", False), ("first-light.toml", True)])
def test_the_camera_of_a_scene_of_the_project_is_saved_in_a_copy_alone(
    tmp_path: Path, scene: str, is_own: bool
) -> None:
    known = Path(__file__).parents[3] / "scenes" / "first-light.toml"
    shutil.copyfile(known, tmp_path / "first-light.toml")
    before = known.read_bytes()
    colonnade = Path(sys.executable).with_name("colonnade")
    command = [colonnade, "view", scene, "--config", "tiny", "--size", "8x8", "--no-open"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        assert (
            re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{22}/\n", lines[1])
            and "first-light.toml is in view" in lines[0]
        )
        save = Request(f"{lines[1].strip()}camera", CAMERA, {"Content-Type": "application/json"})
        if is_own:
            urlopen(save).close()
        else:
            with pytest.raises(HTTPError) as error:
                urlopen(save)
            text = error.value.read().decode()
            assert error.value.code == 422 and text.count("\n") == 0
            assert text.endswith(f"cp -r {known.parent} my-scenes && colonnade view my-scenes/first-light.toml")
        assert known.read_bytes() == before
        assert ((tmp_path / "first-light.toml").read_bytes() != before) == is_own
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
