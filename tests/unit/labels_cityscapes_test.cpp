// SPDX-License-Identifier: Apache-2.0
#include "npsim/labels/cityscapes.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>

using npsim::Label;
using npsim::label_from_train_id;
using npsim::LabelSet;
namespace label = npsim::label;

TEST_CASE("names sit at their ids") {
  CHECK(std::string(npsim::kLabels[label::road].name) == "road");
  CHECK(std::string(npsim::kLabels[label::sky].name) == "sky");
  CHECK(std::string(npsim::kLabels[label::traffic_sign].name) == "traffic sign");
  CHECK(std::string(npsim::kLabels[label::bicycle].name) == "bicycle");
  std::set<std::string> names;
  for (const npsim::LabelInfo& info : npsim::kLabels) names.insert(info.name);
  CHECK(names.size() == npsim::kLabels.size());
}

TEST_CASE("train ids: the nineteen of the benchmark, each once, there and back") {
  std::set<int> train_ids;
  for (int i = 0; i < npsim::kLabelCount; ++i) {
    const std::uint8_t train_id = npsim::kLabels[static_cast<std::size_t>(i)].train_id;
    if (train_id == npsim::kIgnoredTrainId) continue;
    CHECK(train_ids.insert(train_id).second);
    CHECK(label_from_train_id(train_id) == i);
  }
  CHECK(train_ids.size() == 19);
  CHECK(*train_ids.begin() == 0);
  CHECK(*train_ids.rbegin() == 18);
}

TEST_CASE("a train id that does not exist, and the ignored one, are unlabeled") {
  for (int id = 19; id <= 255; ++id) CHECK(label_from_train_id(static_cast<std::uint8_t>(id)) == label::unlabeled);
}

TEST_CASE("label sets: what was put in, nothing else, and ids beyond the word are outside") {
  static_assert(LabelSet::of(label::car).contains(label::car));
  const LabelSet set = LabelSet::of(label::unlabeled, label::bicycle);
  for (int id = 0; id <= 255; ++id) {
    CHECK(set.contains(static_cast<Label>(id)) == (id == label::unlabeled || id == label::bicycle));
  }
  CHECK(LabelSet().bits() == 0);
}

TEST_CASE("the sets of the method: foreground and vehicles are surfaces, vehicles are foreground") {
  CHECK((npsim::kForegroundLabels.bits() & npsim::kNoSurfaceLabels.bits()) == 0);
  CHECK((npsim::kVehicleLabels.bits() & ~npsim::kForegroundLabels.bits()) == 0);
  CHECK(npsim::kForegroundLabels.contains(label::pole));
  CHECK(npsim::kForegroundLabels.contains(label::rider));
  CHECK_FALSE(npsim::kForegroundLabels.contains(label::building));
  CHECK_FALSE(npsim::kForegroundLabels.contains(label::road));
  CHECK(npsim::kNoSurfaceLabels.contains(label::sky));
  CHECK(npsim::kNoSurfaceLabels.contains(label::ego_vehicle));
}
