"""Values of a recipe replace the constants and variables of a generated script."""

import ast

import pytest
from msgspec.structs import replace

from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.exceptions import InvalidPackage
from arcor2_hw.runtime.program_values import set_values, with_values

SCRIPT = '''"""Main script."""

def main(res):
    aps = ActionPoints(res)
    # Objects of the scene
    robot: Arm = res.objects["obj_robot"]
    # Project parameters
    speed = -0.5
    name = "board"
    # Variables
    count: int = 3
    found = robot.scan(an="scan")
    speed = 7
    seen.append((speed, name, count))
'''


def parameter(name: str, kind: str, value: str, *, variable: bool = False) -> ProjectParameter:
    found = ProjectParameter(name, kind, value, id=f"pro_{name}")
    return replace(found, variable=True) if variable else found


PROJECT = Project(
    "project",
    "scn_1",
    parameters=[  # the script assigns constants first
        parameter("count", "integer", "3", variable=True),
        parameter("speed", "double", "-0.5"),
        parameter("name", "string", '"board"'),
    ],
)


def assigned(tree: ast.Module) -> dict[str, str]:
    main = tree.body[1]
    assert isinstance(main, ast.FunctionDef)
    nodes = [node for node in main.body if isinstance(node, ast.Assign | ast.AnnAssign) and node.lineno < 12]
    return {ast.unparse(node).partition("=")[0].strip(): ast.unparse(node.value) for node in nodes if node.value}


def test_constants_and_variables_are_replaced_and_lines_stay() -> None:
    tree = ast.parse(SCRIPT)
    before = [node.lineno for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    set_values(tree, PROJECT, {"pro_speed": "0.25", "pro_count": "12"})
    found = assigned(tree)
    assert (found["speed"], found["name"], found["count: int"]) == ("0.25", "'board'", "12")
    assert [node.lineno for node in ast.walk(tree) if isinstance(node, ast.stmt)] == before
    compile(tree, "script.py", "exec")


def test_a_script_that_was_edited_is_refused() -> None:
    with pytest.raises(InvalidPackage, match="assigns 2 constants and variables, the project has 3"):
        set_values(ast.parse(SCRIPT.replace('    name = "board"\n', "")), PROJECT, {"pro_speed": "0.25"})
    with pytest.raises(InvalidPackage, match="value of speed cannot be used"):
        set_values(ast.parse(SCRIPT.replace("-0.5", "-0.6")), PROJECT, {"pro_speed": "0.25"})


def test_the_project_states_the_values_in_use() -> None:
    found = with_values(PROJECT, {"pro_speed": "0.25"})
    assert [each.value for each in found.parameters] == ["3", "0.25", '"board"']
    with pytest.raises(InvalidPackage, match="no constant or variable pro_other"):
        with_values(PROJECT, {"pro_other": "1"})
