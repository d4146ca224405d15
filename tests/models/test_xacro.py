"""Expanding xacro: the part of the language that hand models use, and one line for the rest."""

import math
import os

import pytest

import paxisim
from paxisim.models.xacro import read_robot

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def robot(folder, body, name="hand.xacro"):
    (folder / name).write_text(f'<robot {XACRO} name="hand">{body}</robot>')
    return folder / name


def links(path):
    return [link.get("name") for link in read_robot(path).iter("link")]


def test_expressions(tmp_path):
    defined = '<xacro:property name="width" value="0.02"/><xacro:property name="count" value="3"/>'
    for text, value in (
        ("${1 + 2*3}", 7),
        ("-${0.095/2}", -0.0475),
        ("${radians(-90)}", -math.pi / 2),
        ("${-(1 - 3) / 4}", 0.5),
        ("${cos(pi)}", -1.0),
        ("${width - 0.013}", 0.007),
        ("${'a' == 'a' and width > 0}", True),
        ("${count*4 + 1}", 13),
    ):
        (name,) = links(robot(tmp_path, f'{defined}<link name="{text}"/>'))
        assert eval(name) == pytest.approx(value), text


def test_macros_see_their_caller_and_keep_what_they_define(tmp_path):
    path = robot(
        tmp_path,
        """
        <xacro:macro name="tip" params="name side:='left' twice:=0 gap=0.5">
          <xacro:property name="full" value="${name}_${side}_${kind}"/>
          <link name="${full}"/>
          <xacro:if value="${twice == 1}"><link name="${full}_again"/></xacro:if>
          <xacro:unless value="${twice}"><link name="${gap + 1}"/></xacro:unless>
        </xacro:macro>
        <xacro:macro name="hand" params="kind">
          <xacro:tip name="a"/><xacro:tip name="b" side="up" twice="1"/>
        </xacro:macro>
        <xacro:hand kind="curved"/>
        """,
    )
    assert links(path) == ["a_left_curved", "1.5", "b_up_curved", "b_up_curved_again"]
    path = robot(tmp_path, path.read_text().split(">", 1)[1].replace("</robot>", '<link name="${full}"/>'))
    with pytest.raises(paxisim.InvalidValueError, match="nothing defines 'full'"):
        read_robot(path)


def test_includes_and_arguments_of_a_package_found_without_ros(tmp_path):
    folder = tmp_path / "models-main" / "urdf"
    folder.mkdir(parents=True)
    (tmp_path / "models-main" / "package.xml").write_text("<package><name>my_models</name></package>")
    robot(folder, '<xacro:arg name="prefix" default="base_"/><link name="$(arg prefix)1"/>', "part.xacro")
    path = robot(
        folder,
        '<xacro:arg name="prefix" default="my_"/><xacro:include filename="$(find my_models)/urdf/part.xacro"/>'
        '<xacro:include filename="part.xacro"/>',
    )
    assert links(path) == ["my_1", "my_1"]
    path.write_text(path.read_text().replace("my_models", "other"))
    with pytest.raises(paxisim.InvalidValueError, match="no folder above it is the package 'other'"):
        read_robot(path)


REFUSED = [
    ("<link name=\"${__import__('os').mkdir('made')}\"/>", "more than arithmetic"),
    ('<link name="${(1).__class__}"/>', "more than arithmetic"),
    ('<link name="${[x for x in (1,)]}"/>', "more than arithmetic"),
    ("<link name=\"${'a' * 1000000000}\"/>", "more than arithmetic"),
    ('<link name="${9**9**9**9}"/>', "more than arithmetic"),
    ('<link name="${1/0}"/>', "division by zero"),
    ('<link name="${1 +}"/>', "cannot be evaluated"),
    ('<link name="${sqrt(-1)}"/>', "cannot be evaluated"),
    ('<link name="$(eval 1+1)"/>', "not known here"),
    ('<link name="${nothing}"/>', "nothing defines 'nothing'"),
    ('<xacro:element xacro:name="link"/>', "no macro or known instruction <xacro:element"),
    ('<xacro:if value="perhaps"><link name="a"/></xacro:if>', "neither true nor false"),
    ('<xacro:macro name="m" params="*block"><link name="a"/></xacro:macro>', "macro parameters of a kind"),
    ('<xacro:macro name="m" params="a"/><xacro:m/>', "needs the parameter 'a'"),
    ('<xacro:macro name="m" params="a"/><xacro:m a="1" b="2"/>', "has no parameter 'b'"),
    ('<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>', "deep"),
    ('<xacro:include filename="hand.xacro"/>', "deep"),
]


def test_the_rest_is_refused_in_one_line_and_nothing_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for body, why in REFUSED:
        with pytest.raises(paxisim.InvalidValueError, match=why) as refused:
            read_robot(robot(tmp_path, body))
        assert "\n" not in str(refused.value)
        assert "xacro hand.xacro > hand.urdf" in str(refused.value)
        assert os.listdir(tmp_path) == ["hand.xacro"]


def test_files_that_are_no_models(tmp_path):
    path = tmp_path / "a.urdf"
    for text, why in (("<mujoco/>", "expected the element <robot>, got <mujoco>"), ("<robot>", "cannot read .*a.urdf")):
        path.write_text(text)
        with pytest.raises(paxisim.InvalidValueError, match=why):
            read_robot(path)
    with pytest.raises(paxisim.InvalidValueError, match=r"cannot read .*none\.urdf"):
        read_robot(tmp_path / "none.urdf")


def test_macros_without_end_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("paxisim.models.xacro.MAX_ELEMENTS", 1000)
    doubled = "".join(
        f'<xacro:macro name="m{n + 1}" params=""><xacro:m{n}/><xacro:m{n}/></xacro:macro>' for n in range(40)
    )
    path = robot(tmp_path, f'<xacro:macro name="m0" params=""/>{doubled}<xacro:m40/>')
    with pytest.raises(paxisim.InvalidValueError, match="more than 1000 elements"):
        read_robot(path)
