// SPDX-License-Identifier: Apache-2.0
// Any executor, any observer and any sink, each behind one type, so that what takes them is compiled once: the
// generated street (street/) and the pipeline (tool/engine.hpp).
//
// Each refers to an object that has to outlive it. Cost: one indirect call for each chunk of work and for each message;
// results are the same bits as without.
#ifndef NPSIM_SAMPLES_ANY_HPP
#define NPSIM_SAMPLES_ANY_HPP

#include <cstddef>
#include <memory>
#include <type_traits>

#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"

namespace npsim {

class AnyExecutor {
 public:
  template <class Executor, class = std::enable_if_t<!std::is_same_v<std::remove_const_t<Executor>, AnyExecutor>>>
  AnyExecutor(Executor& executor)  // NOLINT(google-explicit-constructor)
      : executor_(const_cast<void*>(static_cast<const void*>(std::addressof(executor)))),
        for_chunks_([](void* e, std::size_t count, std::size_t chunk, Work work) {
          static_cast<Executor*>(e)->for_chunks(count, chunk, work);
        }) {}

  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    using Function = std::remove_reference_t<F>;
    const auto call = [](void* function, std::size_t begin, std::size_t end) {
      (*static_cast<Function*>(function))(begin, end);
    };
    for_chunks_(executor_, count, chunk, {call, const_cast<void*>(static_cast<const void*>(std::addressof(f)))});
  }

 private:
  struct Work {
    void (*call)(void* function, std::size_t begin, std::size_t end);
    void* function;
    void operator()(std::size_t begin, std::size_t end) const { call(function, begin, end); }
  };
  void* executor_;
  void (*for_chunks_)(void* executor, std::size_t count, std::size_t chunk, Work work);
};

class AnyObserver {
 public:
  template <class Observer, class = std::enable_if_t<!std::is_same_v<std::remove_const_t<Observer>, AnyObserver>>>
  AnyObserver(Observer& observer)  // NOLINT(google-explicit-constructor)
      : observer_(const_cast<void*>(static_cast<const void*>(std::addressof(observer)))),
        calls_{[](void* o, Stage stage) { static_cast<Observer*>(o)->begin(stage); },
               [](void* o, std::size_t done, std::size_t total) { static_cast<Observer*>(o)->progress(done, total); },
               [](void* o, Stage stage) { static_cast<Observer*>(o)->end(stage); },
               [](void* o, Stage stage, const ImageView<const float>& depth) {
                 static_cast<Observer*>(o)->depth(stage, depth);
               },
               [](void* o, const ImageView<const Vec3f>& albedo, const ImageView<const float>& sun,
                  const DaylightReport& report) { static_cast<Observer*>(o)->daylight(albedo, sun, report); },
               [](void* o) -> bool { return static_cast<Observer*>(o)->cancelled(); }} {}

  void begin(Stage stage) const { calls_.begin(observer_, stage); }
  void progress(std::size_t done, std::size_t total) const { calls_.progress(observer_, done, total); }
  void end(Stage stage) const { calls_.end(observer_, stage); }
  void depth(Stage stage, const ImageView<const float>& depth) const { calls_.depth(observer_, stage, depth); }
  void daylight(const ImageView<const Vec3f>& albedo, const ImageView<const float>& sun,
                const DaylightReport& report) const {
    calls_.daylight(observer_, albedo, sun, report);
  }
  [[nodiscard]] bool cancelled() const { return calls_.cancelled(observer_); }

 private:
  struct Calls {
    void (*begin)(void* observer, Stage stage);
    void (*progress)(void* observer, std::size_t done, std::size_t total);
    void (*end)(void* observer, Stage stage);
    void (*depth)(void* observer, Stage stage, const ImageView<const float>& depth);
    void (*daylight)(void* observer, const ImageView<const Vec3f>& albedo, const ImageView<const float>& sun,
                     const DaylightReport& report);
    bool (*cancelled)(void* observer);
  };
  void* observer_;
  Calls calls_;
};

}  // namespace npsim

#endif  // NPSIM_SAMPLES_ANY_HPP
