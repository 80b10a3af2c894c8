// SPDX-License-Identifier: Apache-2.0
// The two plainest ways to give depth to pixels that have none, as yardsticks for better ones.
//
// Nearest: the value of the nearest sample by Euclidean distance; of equally near ones the first in reading order.
// Linear: 1/z, linearly over the Delaunay triangle of the samples that the pixel lies in. The four corners just outside
// the picture, each with its nearest sample's value, join the samples, so that every pixel lies in a triangle. Samples
// amid samples bound no triangle with a missing pixel and are left out; the others' triangles are the same without
// them. All predicates are exact in 64 bits for sides up to 16384.
// Both know nothing of labels. Cost: about n log n for n samples beside missing pixels.
#ifndef NPSIM_SAMPLES_LAB_SIMPLE_FILL_HPP
#define NPSIM_SAMPLES_LAB_SIMPLE_FILL_HPP

#include "npsim/core/image_view.hpp"
#include "npsim/io/image.hpp"

namespace npsim::tool {

// Valid depths stay. Without any, the result is 0.
[[nodiscard]] io::Image<float> filled_by_nearest(ImageView<const float> depth);
[[nodiscard]] io::Image<float> filled_linearly(ImageView<const float> depth);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_SIMPLE_FILL_HPP
