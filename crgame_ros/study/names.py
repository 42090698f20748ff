# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names in studies, which become names of columns, files and folders."""

from typing import Annotated

from crgame_ros.schema.marks import Wording

# A column name in tables that R, SQL and pandas accept without quotes.
ColumnName = Annotated[str, Wording('[a-z][a-z0-9_]{0,39}',
                                    'begin with a letter a-z, then letters, digits and _')]
Name = Annotated[str, Wording('[A-Za-z0-9][A-Za-z0-9_-]{0,39}',
                              'give 1 to 40 letters, digits, - and _')]
