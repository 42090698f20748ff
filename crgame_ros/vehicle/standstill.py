# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Below which speed something stands: one constant for each reason to ask [m/s]."""

# What a wheel encoder reads as nothing: a vehicle that surely has not moved.
ENCODER_REST = 0.01
# Of a planned state: planners end a stop with a rounding error, and a tracker must not take a plan
# that starts or ends gently for one that rests.
PLANNED_REST = 0.02
# Of a measured, recorded or driven speed: nuPlan's bound for its kinds of contact. A slower motion
# is noise, and its direction says nothing.
REST = 0.05
# Of who decides whether to go on: laws of car following come near 0 ever more slowly, so that who
# is slower, and wants to go hardly at all, is held; it has halted.
STANDING = 0.1
# Of others in the eyes of who waits for them or walks past: a queue that creeps on stands as well.
QUEUEING = 0.3
