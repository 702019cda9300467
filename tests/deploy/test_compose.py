"""The compose file, by the Compose specification's schema and by what it must say; nothing is started."""

import re
import subprocess
import sys
from typing import Any

import pytest

from tests.deploy.paths import DEPLOY, documents

FILE = DEPLOY / "compose/compose.yaml"
COMPOSE = documents(FILE)[0]
SERVICES = COMPOSE["services"]


def test_it_follows_the_schema_of_the_compose_specification() -> None:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(FILE)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("service", SERVICES.values(), ids=SERVICES.keys())
def test_a_service_has_no_privilege_and_a_memory_limit(service: dict[str, Any]) -> None:
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["read_only"] is True
    assert re.fullmatch(r"\d+[mg]", service["mem_limit"])


def test_ports_are_published_to_this_machine_only_and_the_scheduler_s_own_is_not() -> None:
    ports = [port for service in SERVICES.values() for port in service.get("ports", [])]
    assert ports == ["127.0.0.1:8787:8787"]


def test_data_are_mounted_alike_and_read_only_where_they_are_read() -> None:
    mounts = [
        {mount for mount in SERVICES[name]["volumes"] if ":/data" in mount} for name in ("worker", "launcher")
    ]
    assert mounts[0] == mounts[1]
    assert all(mount.endswith(":/data:ro") for mount in mounts[0])


def test_only_the_launcher_holds_the_runs() -> None:
    holders = [name for name, service in SERVICES.items() if "runs:/runs" in service.get("volumes", [])]
    assert holders == ["launcher"]
    assert "replicas" not in SERVICES["launcher"].get("deploy", {})


def test_a_finished_search_is_not_started_again() -> None:
    assert SERVICES["launcher"]["restart"].startswith("on-failure:")


def test_the_named_volumes_are_declared() -> None:
    named = {
        mount.split(":")[0]
        for service in SERVICES.values()
        for mount in service.get("volumes", [])
        if mount[0] not in "./$"
    }
    assert named == set(COMPOSE["volumes"])


def test_the_configuration_names_the_scheduler_service() -> None:
    address = documents(DEPLOY / "compose/search.yaml")[0]["executor"]["scheduler"]
    assert address == "tcp://scheduler:8786"
    assert address in SERVICES["worker"]["command"]
