# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Names in studies, which become columns, files and folders."""

from typing import Annotated

from crgame_ros.schema.marks import Wording

# Of a column in tables: what R, SQL and pandas take without quotes.
ColumnName = Annotated[str, Wording('[a-z][a-z0-9_]{0,39}',
                                    'begin with a letter a-z, then letters, digits and _')]
Name = Annotated[str, Wording('[A-Za-z0-9][A-Za-z0-9_-]{0,39}',
                              'give 1 to 40 letters, digits, - and _')]
