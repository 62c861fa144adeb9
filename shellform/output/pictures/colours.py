"""The colours of deviations, in pictures and on the page."""

from __future__ import annotations

# Viridis (van der Walt and Smith, public domain) at 17 equal steps, red, green and blue up to 255:
# perceptually uniform, safe for the colour-blind.
VIRIDIS = (
    (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141), (44, 114, 142),
    (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115), (94, 201, 98),
    (132, 212, 75),
    (173, 220, 48), (216, 226, 25), (253, 231, 37),
)  # fmt: skip
