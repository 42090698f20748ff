# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Linear mixed models of trials with a random intercept of each participant, by statsmodels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
import math
import warnings

from crgame_ros.paths import extra_install
from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Comparison
from crgame_ros.study.trial_settings import Factor
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ModelFormula:
    """
    A model: a measure by factors without interactions, and an intercept of each participant.

    :param measure: column of the measure.
    :param factors: the fixed effects.
    :param blocks: names of the blocks whose trials it uses: they cross these factors.
    """

    measure: str
    factors: tuple[Factor, ...]
    blocks: tuple[str, ...]

    def text(self, columns: Mapping[str, str]) -> str:
        """
        Return it as lme4 has it.

        :param columns: of the factors, by their names.
        """
        terms = ' + '.join(columns[factor.name] for factor in self.factors)
        return f'{self.measure} ~ {terms} + (1 | participant)'


def model_formulas(study: StudyFile) -> list[ModelFormula]:
    """
    Return the model of each planned comparison, each once.

    Its trials are those of the blocks that cross the comparison's factor, of groups those of all
    blocks, without blocks that have a staircase. Its fixed effects are the factors that all these
    blocks cross, and the groups.
    """
    return list(dict.fromkeys(_formula(study, comparison)
                              for comparison in study.analysis.comparisons))


def _formula(study: StudyFile, comparison: Comparison) -> ModelFormula:
    blocks = study.compared_blocks(comparison.factor)
    factors = tuple(factor for factor in study.factors
                    if all(factor in study.factors_of(block) for block in blocks))
    groups = () if study.groups is None else (study.groups.factor,)
    return ModelFormula(comparison.measure, (*factors, *groups),
                        tuple(block.name for block in blocks))


@dataclass(frozen=True)
class FixedEffect:
    """
    A fixed effect: the intercept, or a level's difference from the first of its factor.

    :param name: of it.
    :param value: its estimate.
    :param error: standard error.
    :param low: end of its 95 % interval, by the normal distribution.
    :param high: the other end.
    :param z: estimate over standard error.
    :param p: two-sided, by the normal distribution.
    """

    name: str
    value: float
    error: float
    low: float
    high: float
    z: float
    p: float


@dataclass(frozen=True)
class MixedModel:
    """
    A fitted model (REML).

    :param formula: of it.
    :param trials: number of trials with a value.
    :param participants: their number.
    :param effects: fixed effects.
    :param participant_sd: standard deviation of the participants' intercepts.
    :param residual_sd: of the residuals.
    :param problem: what the fit warned of, or why there is none; empty if nothing.
    """

    formula: ModelFormula
    trials: int
    participants: int
    effects: tuple[FixedEffect, ...] = ()
    participant_sd: float = math.nan
    residual_sd: float = math.nan
    problem: str = ''


def missing_extra() -> str:
    """Return what installs the package for models, or an empty text where it is installed."""
    return extra_install('statistics') if find_spec('statsmodels') is None else ''


def fit_model(formula: ModelFormula, rows: Sequence[Mapping[str, object]],
              columns: Mapping[str, str]) -> MixedModel:
    """
    Fit a model by restricted maximum likelihood; needs statsmodels.

    :param rows: of trials; those without a finite value are left out.
    :param columns: of the factors, by their names.
    """
    used = [row for row in rows if row['block'] in formula.blocks
            and isinstance(value := row.get(formula.measure), int | float)
            and math.isfinite(value)]
    people = sorted({str(row['participant']) for row in used})
    names, design = _design(formula, used, columns)
    model = MixedModel(formula, len(used), len(people))
    if len(people) < 2 or len(used) <= len(people) + len(names) \
            or np.linalg.matrix_rank(design) < len(names):
        return replace(model, problem='there are too few trials for it')
    values = np.array([row[formula.measure] for row in used], dtype=np.float64)
    return _fitted(model, values, design, np.array([people.index(str(row['participant']))
                                                    for row in used]), names)


def _fitted(model: MixedModel, values: FloatArray, design: FloatArray,
            groups: NDArray[np.int64], names: Sequence[str]) -> MixedModel:
    from statsmodels.regression.mixed_linear_model import MixedLM
    # statsmodels tells a variance of zero by an absolute bound: it gets standardised values.
    scale = float(values.std()) or 1.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        try:
            fit = MixedLM((values - values.mean()) / scale, design, groups).fit(reml=True)
        except (ValueError, np.linalg.LinAlgError) as error:
            return replace(model, problem=f'it could not be fitted ({error})')
    told = list(dict.fromkeys(str(each.message).strip() for each in caught
                              if not issubclass(each.category, DeprecationWarning)))
    if not fit.converged and not told:
        told = ['the fit did not converge']
    # The mean that was taken off belongs to the intercept, the first column.
    estimates = scale * np.asarray(fit.fe_params)
    estimates[0] += values.mean()
    errors = scale * np.asarray(fit.bse_fe)
    from scipy.stats import norm
    half = float(norm.ppf(0.975))
    effects = tuple(FixedEffect(
        name, float(value), float(error), float(value - half * error),
        float(value + half * error), float(value / error),
        2.0 * float(norm.sf(abs(value / error))))
        for name, value, error in zip(names, estimates, errors, strict=True))
    return replace(
        model, effects=effects, problem='; '.join(told),
        participant_sd=scale * math.sqrt(float(np.asarray(fit.cov_re)[0, 0])),
        residual_sd=scale * math.sqrt(float(fit.scale)))


def _design(formula: ModelFormula, rows: Sequence[Mapping[str, object]],
            columns: Mapping[str, str]) -> tuple[list[str], FloatArray]:
    """Return names and values of the fixed effects: an intercept, and levels but the first."""
    names, parts = ['(Intercept)'], [np.ones(len(rows))]
    for factor in formula.factors:
        for level in factor.levels[1:]:
            names.append(f'{columns[factor.name]}: {level.name}')
            parts.append(np.array([float(row[columns[factor.name]] == level.name)
                                   for row in rows]))
    return names, np.column_stack(parts)
