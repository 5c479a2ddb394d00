"""`conf/figure.yaml`, its kinds, and the figures of the paper: they compose, and their keys are their classes'."""

import dataclasses

import pytest
from omegaconf import OmegaConf

from runners.config import catalogue, schema
from runners.config.composer import Composer, without_hydra
from runners.config.instantiate import configured
from runners.config.job import Job
from runners.evaluate.figure import validate

CATALOGUE = catalogue.shipped()


@pytest.fixture(scope="module")
def composer():
    schema.register()
    with Composer("figure") as composer:
        yield composer


@pytest.mark.parametrize("option", CATALOGUE.options("figure"))
def test_a_kind_has_the_keys_of_its_config_class(composer, option):
    config = without_hydra(composer.compose([f"figure={option}"]))
    assert not OmegaConf.missing_keys(config)
    cls, _ = configured(config.figure, "figure")
    written = {key.name for key in CATALOGUE.keys(f"figure/{option}")}
    assert written == {field.name for field in dataclasses.fields(cls.Config)}
    assert cls.name == option
    assert isinstance(cls.drives, bool)


@pytest.mark.parametrize("option", CATALOGUE.options("experiment/figure"))
def test_every_figure_of_the_paper_is_one_config(composer, option):
    config = composer.compose([f"experiment=figure/{option}"])
    validate(Job.composed(without_hydra(config), config.hydra, composer.catalogue))
    swept = (config.hydra.sweeper.params or {}).get("system", "")
    assert set(filter(None, swept.replace(" ", "").split(","))) <= set(CATALOGUE.options("system"))
