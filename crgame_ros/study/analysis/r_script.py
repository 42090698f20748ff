# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the planned analysis as an R script that reads trials.csv beside it."""

from collections.abc import Iterator, Mapping

from crgame_ros.study.analysis.mixed_model import model_formulas, ModelFormula
from crgame_ros.study.analysis.planned_tests import FLAGS
from crgame_ros.study.file import StudyFile
from crgame_ros.study.planned_analysis import Comparison

_HEAD = """\
# The planned analysis of the study {name}, as crgame_ros does it. Run it in this folder:
#
#   Rscript analysis.R
#
# Needs the packages lme4 and lmerTest for the mixed models.
trials <- read.csv("trials.csv", na.strings = c("", "NaN"), check.names = FALSE,
                   colClasses = c({texts}))
alpha <- {alpha!r}
{flagged}
# Paired test of one measure: each participant's means of two levels, second less first.
compare <- function(measure, factor, first, second, alternative) {{
  used <- trials[is.finite(trials[[measure]]) & !is.na(trials[[factor]]), ]
  means <- tapply(used[[measure]], list(used$participant, used[[factor]]), mean)
  if (!all(c(first, second) %in% colnames(means))) return(NULL)
  means <- means[complete.cases(means[, c(first, second)]), c(first, second), drop = FALSE]
  n <- nrow(means)
  if (n < 2) return(NULL)
  difference <- means[, 2] - means[, 1]
  test <- t.test(difference, alternative = alternative)
  interval <- t.test(difference, conf.level = 1 - alpha)$conf.int
  rank <- wilcox.test(difference, alternative = alternative, exact = n <= 50, correct = FALSE)
  d_av <- mean(difference) / mean(c(sd(means[, 1]), sd(means[, 2])))
  data.frame(measure = measure, factor = factor, first = first, second = second, n = n,
             difference = mean(difference), low = interval[1], high = interval[2],
             t = unname(test$statistic), p = test$p.value, p_wilcoxon = rank$p.value,
             d_z = mean(difference) / sd(difference), d_av = d_av,
             g_av = d_av * (1 - 3 / (4 * (n - 1) - 1)){more})
}}
"""


_BETWEEN = """
# Test of one measure between groups: each participant's mean over all trials, second less first.
compare_groups <- function(measure, factor, first, second, alternative) {
  used <- trials[is.finite(trials[[measure]]) & trials[[factor]] %in% c(first, second), ]
  if (nrow(used) == 0) return(NULL)
  means <- aggregate(used[[measure]], list(participant = used$participant,
                                           group = used[[factor]]), mean)
  a <- means$x[means$group == first]
  b <- means$x[means$group == second]
  n <- length(a) + length(b)
  if (min(length(a), length(b)) < 2) return(NULL)
  test <- t.test(b, a, alternative = alternative)
  interval <- t.test(b, a, conf.level = 1 - alpha)$conf.int
  rank <- wilcox.test(b, a, alternative = alternative, exact = min(length(a), length(b)) <= 8)
  pooled <- sqrt(((length(a) - 1) * var(a) + (length(b) - 1) * var(b)) / (n - 2))
  d_s <- (mean(b) - mean(a)) / pooled
  data.frame(measure = measure, factor = factor, first = first, second = second, n = n,
             difference = mean(b) - mean(a), low = interval[1], high = interval[2],
             t = unname(test$statistic), p = test$p.value, p_wilcoxon = rank$p.value,
             d_z = NA, d_av = NA, g_av = NA, d_s = d_s, g_s = d_s * (1 - 3 / (4 * n - 9)))
}
"""


def r_script(study: StudyFile, columns: Mapping[str, str]) -> str:
    """
    Return the script.

    Names of columns are in backticks or quotes, so that words of R may be names.

    :param columns: of the factors, by their names.
    """
    analysis = study.analysis
    flagged = '' if analysis.flagged == 'use' else (
        '# Trials beyond a bound of quality are left out.\n'
        f'trials <- trials[!({" | ".join(f"trials${flag} %in% TRUE" for flag in FLAGS)}), ]\n')
    if study.staircases:
        flagged += ('# Of staircases, answers choose the levels of the trials.\n'
                    'trials <- trials[!(trials$block %in% '
                    f'c({", ".join(map(_text, study.staircases))})), ]\n')
    # Both kinds of tests are rows of one table.
    more = '' if study.groups is None else ', d_s = NA, g_s = NA'
    # Levels such as 01 and T are texts.
    texts = ',\n                                  '.join(
        f'{_text(name)} = "character"' for name in ('participant', 'block', *columns.values()))
    parts = [_HEAD.format(name=study.name, alpha=analysis.alpha, flagged=flagged, more=more,
                          texts=texts)]
    parts += [_BETWEEN] if study.groups is not None else []
    parts += _tests(study, columns)
    parts += ['\nlibrary(lme4)\nlibrary(lmerTest)\n']
    parts += [_model(formula, columns) for formula in model_formulas(study)]
    return ''.join(parts)


def _tests(study: StudyFile, columns: Mapping[str, str]) -> Iterator[str]:
    groups = [[_call(study, comparison, pair, columns) for pair in study.pairs_of(comparison)]
              for comparison in study.analysis.comparisons]
    if study.analysis.family == 'analysis':
        groups = [[call for group in groups for call in group]]
    for calls in groups:
        yield '\ntests <- rbind(\n' + ',\n'.join(f'  {call}' for call in calls) + ')\n'
        # A test without data still counts in its family.
        yield f'tests$p_holm <- p.adjust(tests$p, method = "holm", n = {len(calls)})\n'
        yield 'print(tests)\n'


def _call(study: StudyFile, comparison: Comparison, pair: tuple[str, str],
          columns: Mapping[str, str]) -> str:
    alternative = comparison.alternative.replace('-', '.')
    texts = (comparison.measure, columns[comparison.factor], *pair, alternative)
    function = 'compare_groups' if comparison.factor == study.between else 'compare'
    return f'{function}({", ".join(_text(text) for text in texts)})'


def _model(formula: ModelFormula, columns: Mapping[str, str]) -> str:
    blocks = ', '.join(_text(block) for block in formula.blocks)
    lines = [f'\nused <- trials[trials$block %in% c({blocks}) & '
             f'is.finite(trials[[{_text(formula.measure)}]]), ]']
    for factor in formula.factors:
        name = _text(columns[factor.name])
        levels = ', '.join(map(_text, factor.names))
        lines.append(f'used[[{name}]] <- factor(used[[{name}]], levels = c({levels}))')
    terms = ' + '.join(f'`{columns[factor.name]}`' for factor in formula.factors)
    lines += [f'model <- lmer(`{formula.measure}` ~ {terms} + (1 | participant), data = used, '
              'REML = TRUE)', 'print(summary(model))', 'print(confint(model, method = "Wald"))']
    return '\n'.join(lines) + '\n'


def _text(text: str) -> str:
    escaped = text.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{escaped}"'
