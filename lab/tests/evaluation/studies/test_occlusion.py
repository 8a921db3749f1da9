"""The occlusion study on one small room, and the truth that it compares with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from colonnade.mesh.load import load_mesh
from colonnade.reference.environment.depth_mesh import full_backdrop
from colonnade.reference.render import render_reference
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view

from colonnade_lab.evaluation.studies.furnished_rooms import FURNISHED
from colonnade_lab.evaluation.studies.occlusion import measure, standing, table, true_occlusion
from colonnade_lab.evaluation.studies.thin_furniture import REPORT, behind_thin_things

SIZE = (320, 240)


def test_furniture_hides_the_object_behind_it() -> None:
    """A chest before a teapot, in a map of a quarter of the pixels."""
    case = replace(FURNISHED["chest"], mesh="teapot:4")
    result = measure(case, case.room("chest", *SIZE), load_mesh(case.mesh))
    assert result.pixels > 300 and result.hidden > 0.2
    assert result.right >= 0.98 and result.without < 0.8
    np.testing.assert_allclose(result.right + result.lost + result.kept, 1.0)
    np.testing.assert_allclose(result.without + result.hidden, 1.0)
    assert result.agrees >= 0.98 and result.psnr > 40 and result.object_psnr > 25
    assert "chest" in table({"chest": result})


def test_thin_things_hide_the_object_behind_them() -> None:
    """Cells of one pixel hold stems, leaves and rungs."""
    case = replace(behind_thin_things(REPORT[0]), mesh="teapot:4")
    result = measure(case, case.room("thin", *SIZE), load_mesh(case.mesh))
    assert result.pixels > 200 and result.right >= 0.98 > result.without


def test_the_reference_hides_what_furniture_hides() -> None:
    """In direct view it shows the truth; with the scene's key off, all of the object."""
    case = replace(FURNISHED["chest"], mesh="teapot:4")
    made, mesh = case.room("chest", *SIZE), load_mesh(case.mesh)
    backdrop = full_backdrop(made.environment)
    view = make_view(Placed(standing(case, mesh), mesh.extent, made.environment), *SIZE, mesh.materials)
    meets, visible = true_occlusion(mesh, view, made)
    shown = render_reference(mesh, view, backdrop=backdrop).object_mask
    assert (shown == visible)[meets].mean() > 0.99 and not shown[~meets].any()
    whole = render_reference(mesh, replace(view, occlusion=False), backdrop=backdrop).object_mask
    np.testing.assert_array_equal(whole, meets)
