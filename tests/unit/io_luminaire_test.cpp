// SPDX-License-Identifier: Apache-2.0
// Luminaire files: flux, symmetry, orientation, and every way in which a file may be broken.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>
#include <vector>

#include "io_fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/io/luminaire.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/photometry.hpp"

namespace {

using namespace npsim;
constexpr double kPi = 3.14159265358979323846;

std::vector<double> steps(double first, double last, double step) {
  std::vector<double> out;
  for (double a = first; a <= last + 1e-9; a += step) out.push_back(a);
  return out;
}

// Something without symmetry but that of the planes given; in cd per klm of the lamps.
double lopsided(double c_deg, double gamma_deg) {
  const double c = c_deg * kPi / 180;
  const double g = gamma_deg * kPi / 180;
  return 200 + 100 * std::cos(g) + 50 * std::sin(g) * std::sin(c) + 30 * std::sin(g) * std::cos(2 * c);
}

template <class F>
std::string ies_text(const std::vector<double>& gammas, const std::vector<double>& planes, const F& candela,
                     const std::string& head = "IESNA:LM-63-2002\n[TEST] 1\nTILT=NONE\n",
                     const std::string& factors = "1 1000 1") {
  std::ostringstream out;
  out.precision(17);
  out << head << factors << " " << gammas.size() << " " << planes.size() << " 1 2 .3 .6 0\n1 1 100\n";
  for (const double g : gammas) out << g << " ";
  out << "\n";
  for (const double c : planes) out << c << "\r\n";
  for (const double c : planes) {
    for (const double g : gammas) out << candela(c, g) << ",";
    out << "\n";
  }
  return out.str();
}

// Symmetry and the planes that it stores.
template <class F>
std::string ldt_text(int symmetry, int around, const std::vector<double>& gammas, const F& candela,
                     double flux = 1000) {
  std::ostringstream out;
  out.precision(17);
  out << "Maker\n1\n" << symmetry << "\n" << around << "\n" << 360.0 / around << "\n" << gammas.size() << "\n5\n";
  out << "report\nname\nnumber\nfile\ndate\n600\n300\n100\n500\n200\n0\n0\n0\n0\n100\n80\n1\n0\n2\n";
  out << "1\nLED\n" << flux << "\n4000\n80\n60\n2\nother\n2000\n3000\n80\n90\n";
  for (int i = 0; i < 10; ++i) out << "0,5\n";
  for (int c = 0; c < around; ++c) out << c * 360.0 / around << "\n";
  for (const double g : gammas) out << g << "\n";
  const int first = symmetry == 3 ? 3 * around / 4 : 0;
  const int stored = symmetry == 0 ? around : symmetry == 1 ? 1 : (symmetry == 4 ? around / 4 : around / 2) + 1;
  for (int p = first; p < first + stored; ++p) {
    for (const double g : gammas) out << candela((p % around) * 360.0 / around, g) << "\n";
  }
  return out.str();
}

io::Expected<io::Luminaire> read_luminaire_text(const std::string& name, const std::string& text, double turn_deg = 0) {
  const io_test::TemporaryFolder folder;
  io_test::put(folder / name, text);
  return io::read_luminaire(folder / name, turn_deg);
}

// In a frame with the axis down z: C from x to y.
double candela_at(const io::Luminaire& l, double c_deg, double gamma_deg) {
  const double c = c_deg * kPi / 180;
  const double g = gamma_deg * kPi / 180;
  const double relative = static_cast<double>(luminaire_relative(l.table, static_cast<float>(std::cos(g)),
                                                                 static_cast<float>(std::sin(g) * std::cos(c)),
                                                                 static_cast<float>(std::sin(g) * std::sin(c))));
  return relative * static_cast<double>(l.table.flux_lm) / static_cast<double>(l.table.flux_sr);
}

double lambertian(double, double gamma_deg) { return 1000 / kPi * std::max(std::cos(gamma_deg * kPi / 180), 0.0); }

void check_fault(const std::string& name, const std::string& text, const std::string& words) {
  const auto result = read_luminaire_text(name, text);
  REQUIRE(!result.ok());
  INFO(result.error().line());
  CHECK(result.error().line().find(words) != std::string::npos);
  CHECK(result.error().line().find("expected") != std::string::npos);
}

}  // namespace

TEST_CASE("luminaire: a Lambertian lamp of 1000 lm has 1000 lm and pi per candela within .1 %, in both formats") {
  for (const double step : {1.0, 2.5, 5.0}) {
    for (const std::string& file : {std::string("a.ies"), std::string("a.LDT")}) {
      const auto gammas = steps(0, 90, step);
      const auto l = read_luminaire_text(
          file, file == "a.ies" ? ies_text(gammas, {0}, lambertian) : ldt_text(1, 1, gammas, lambertian));
      REQUIRE(l.ok());
      CHECK(static_cast<double>(l.value().table.flux_lm) == doctest::Approx(1000).epsilon(1e-3));
      CHECK(static_cast<double>(l.value().table.flux_sr) == doctest::Approx(kPi).epsilon(1e-3));
      CHECK(candela_at(l.value(), 77, 40) == doctest::Approx(lambertian(0, 40)).epsilon(1e-3));
      CHECK(candela_at(l.value(), 0, 91) == 0);
      CHECK(candela_at(l.value(), 0, 180) == 0);
    }
  }
}

TEST_CASE("luminaire: the flux is the integral of what is interpolated, planes at odd angles and turned too") {
  const auto gammas = std::vector<double>{0, 7, 31, 33.5, 80, 110, 180};
  const auto l = read_luminaire_text("a.ies", ies_text(gammas, {0, 13, 100, 101, 222, 360}, lopsided), 33.3);
  REQUIRE(l.ok());
  double sum = 0;
  const int n = 400;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double g = (i + 0.5) * kPi / n;
      sum += candela_at(l.value(), (j + 0.5) * 360 / n, g * 180 / kPi) * std::sin(g) * (kPi / n) * (2 * kPi / n);
    }
  }
  CHECK(static_cast<double>(l.value().table.flux_lm) == doctest::Approx(sum).epsilon(3e-4));
}

TEST_CASE(
    "luminaire: planes to 90, 180 and 360 degrees, and EULUMDAT's five symmetries, give the same lamp all round") {
  const auto gammas = steps(0, 180, 5);
  const auto quarter = [](double c, double g) { return 300 + 100 * std::cos(g / 40) * std::cos(2 * c * kPi / 180); };
  const auto at_c0 = [](double c, double g) { return 300 + g * std::cos(c * kPi / 180); };
  const auto at_c90 = [](double c, double g) { return 300 + g * std::sin(c * kPi / 180); };
  const auto compare = [&](const io::Expected<io::Luminaire>& l, const auto& candela) {
    REQUIRE(l.ok());
    for (double c = 0; c < 360; c += 15) {
      for (const double g : {0.0, 5.0, 60.0, 175.0}) {
        CHECK(candela_at(l.value(), c, g) == doctest::Approx(candela(g == 0 ? 0 : c, g)).epsilon(1e-5));
      }
    }
  };
  const auto pole = [](const auto& candela) {  // straight down is one direction, whatever the plane
    return [candela](double c, double g) { return candela(g == 0 || g == 180 ? 0 : c, g); };
  };
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(0, 90, 15), pole(quarter))), pole(quarter));
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(0, 360, 15), pole(lopsided))), pole(lopsided));
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(0, 345, 15), pole(lopsided))), pole(lopsided));
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(90, 270, 15), pole(at_c90))), pole(at_c90));
  // Planes from 0 to 180: 0 is the road's side, where CIE has 90.
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(0, 180, 15), pole(at_c0))), pole(at_c90));
  compare(read_luminaire_text("a.ies", ies_text(gammas, steps(0, 180, 15), pole(at_c0)), -90), pole(at_c0));
  compare(read_luminaire_text("a.ldt", ldt_text(0, 24, gammas, pole(lopsided))), pole(lopsided));
  compare(read_luminaire_text("a.ldt", ldt_text(2, 24, gammas, pole(at_c0))), pole(at_c0));
  compare(read_luminaire_text("a.ldt", ldt_text(3, 24, gammas, pole(at_c90))), pole(at_c90));
  compare(read_luminaire_text("a.ldt", ldt_text(4, 24, gammas, pole(quarter))), pole(quarter));
  const auto turned = [&](double c, double g) { return pole(lopsided)(c + 20, g); };
  compare(read_luminaire_text("a.ldt", ldt_text(0, 72, gammas, pole(lopsided)), -20), turned);
}

TEST_CASE(
    "luminaire: multiplier, ballast, the older photometric factor, lamps' flux and a tilt count as the formats say") {
  const std::vector<double> gammas = {0, 90, 180};
  const auto even = [](double, double) { return 100.0; };
  const auto peak = [](const io::Expected<io::Luminaire>& l) {
    REQUIRE(l.ok());
    return candela_at(l.value(), 0, 0);
  };
  CHECK(peak(read_luminaire_text("a.ies", ies_text(gammas, {0}, even))) == doctest::Approx(100));
  CHECK(peak(read_luminaire_text("a.ies", ies_text(gammas, {0}, even, "IESNA91\nTILT=NONE\n", "2 -1 2.5"))) ==
        doctest::Approx(250));
  std::string text = ies_text(gammas, {0}, even, "an old lamp\nTILT=NONE\n");
  text.replace(text.find("\n1 1 100\n"), 9, "\n.5,.8 100\n");
  CHECK(peak(read_luminaire_text("a.ies", text)) == doctest::Approx(40));
  text.replace(0, 11, "IESNA:LM-63-1995");
  CHECK(peak(read_luminaire_text("a.ies", text)) == doctest::Approx(50));
  const std::string tilt = "IESNA:LM-63-2002\nTILT=INCLUDE\n1\n3\n0 45 90\n1 .9 .8\n";
  CHECK(peak(read_luminaire_text("a.ies", ies_text(gammas, {0}, even, tilt))) == doctest::Approx(100));
  CHECK(peak(read_luminaire_text("a.ldt", ldt_text(1, 4, gammas, even, 8500))) == doctest::Approx(850));
}

TEST_CASE("luminaire: C = 90 shines over the road of a street lamp, and strength is its flux") {
  const auto l = read_luminaire_text("a.ldt", ldt_text(0, 72, steps(0, 180, 2.5), lopsided));
  REQUIRE(l.ok());
  Emitter e;
  e.profile = EmissionProfile::street_luminaire;
  e.cls = LightClass::street_light_ht;
  e.axis = {0, 1, 0};
  e.up = {0, 0, 1};  // cross(up, axis) is where the road is
  LightSetEntry entry;
  entry.cls = LightClass::street_light_ht;
  entry.strength = 5000;
  entry.xy = {0.4F, 0.4F};
  entry.luminaire = &l.value().table;
  Emitter window;
  window.cls = LightClass::window_building;
  Emitter emitters[] = {e, window};
  assign_luminaires(Span<const LightSetEntry>(&entry, 1), Span<Emitter>(emitters));
  CHECK(emitters[1].profile == EmissionProfile::lambert);
  REQUIRE(emitters[0].profile == EmissionProfile::measured);
  const Vec3f over = cross(e.up, e.axis);
  const Activation a = make_activation(emitters[0], true, 1, 5000, entry.xy);
  const double klm = static_cast<double>(l.value().table.flux_lm) / 1000;
  for (const double c : {0.0, 90.0, 180.0, 270.0, 40.0}) {
    for (const double g : {10.0, 60.0, 85.0}) {
      const auto cosine = [](double deg) { return static_cast<float>(std::cos(deg * kPi / 180)); };
      const auto sine = [](double deg) { return static_cast<float>(std::sin(deg * kPi / 180)); };
      const Vec3f d = e.axis * cosine(g) + e.up * (sine(g) * cosine(c)) + over * (sine(g) * sine(c));
      CHECK(static_cast<double>(luminance(a.intensity_cd) * relative_intensity(emitters[0], d)) ==
            doctest::Approx(lopsided(c, g) * 5 / klm).epsilon(1e-3));
    }
  }
}

TEST_CASE("luminaire: an IES file's faults are named by line and field") {
  const std::vector<double> gammas = {0, 45, 90};
  const std::string good = ies_text(gammas, {0}, lambertian);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    REQUIRE(text.find(from) != std::string::npos);
    return text.replace(text.find(from), from.size(), to);
  };
  REQUIRE(read_luminaire_text("a.ies", good).ok());
  check_fault("a.ies", with("TILT=NONE\n", ""), "TILT: no line has it");
  check_fault("a.ies", with("TILT=NONE", "TILT=tilt.txt"), "TILT: is 'TILT=tilt.txt'");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 1 3 1 2"), "line 4, photometric type: is 2 (B)");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 1 4000000000 1 1"), "line 4, number of vertical angles");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 1 3 100000000 1"), "number of horizontal angles");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 1 361 721 1"), "vertical angle 4");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 1 2.5 1 1"), "expected a whole number");
  check_fault("a.ies", with("1 1000 1 3 1 1", "1 1000 nan 3 1 1"), "candela multiplier: is 'nan'");
  check_fault("a.ies", with("0 45 90", "0 -45 90"), "line 6, vertical angle 2: is -45, expected 0 to 180");
  check_fault("a.ies", with("0 45 90", "0 45 45"), "line 6, vertical angle 3: is not greater");
  check_fault("a.ies", with("0 45 90", "0 45 200"), "vertical angle 3: is 200");
  check_fault("a.ies", with("\n0\r\n", "\n30\r\n"), "horizontal angles: are no whole set");
  check_fault("a.ies", ies_text(gammas, {0, 45}, lambertian), "horizontal angles: are no whole set");
  check_fault("a.ies", ies_text(gammas, {0}, [](double, double) { return 0.0; }), "are all 0");
  check_fault("a.ies", ies_text(gammas, {0}, [](double, double) { return -1.0; }), "candela value 1: is -1");
  check_fault("a.ies", good.substr(0, good.rfind(',', good.size() - 3)), "candela value 3: the file ends before it");
  check_fault("a.ies", ies_text({0}, {0}, lambertian), "number of vertical angles: is 1, expected 2 to 361");
  check_fault("a.txt", good, "expected .ies");
}

TEST_CASE("luminaire: a EULUMDAT file's faults are named by line and field") {
  const std::vector<double> gammas = {0, 45, 90};
  const auto fault = [&](int line, const std::string& value, const std::string& words) {
    std::istringstream in(ldt_text(4, 8, gammas, lambertian));
    std::string text, read_line;
    for (int i = 1; std::getline(in, read_line); ++i) text += (i == line ? value : read_line) + "\n";
    check_fault("a.ldt", text, words);
  };
  REQUIRE(read_luminaire_text("a.ldt", ldt_text(4, 8, gammas, lambertian)).ok());
  fault(3, "7", "line 3, symmetry indicator: is 7, expected 0 to 4");
  fault(4, "6", "number of C planes: is 6, expected a multiple of 4");
  fault(4, "2000000000", "line 4, number of C planes");
  fault(4, "", "line 4, number of C planes: is '', expected a number");
  fault(6, "1", "line 6, number of intensities in a plane");
  fault(26, "0", "line 26, number of sets of lamps");
  fault(29, "many", "line 29, total flux of the lamps: is 'many'");
  fault(49, "-1", "line 49, C angle 1: is -1");
  fault(51, "20", "line 51, C angle 3: is not greater");
  fault(51, "80", "C angles: lack the planes");
  fault(58, "0", "gamma angle 2: is not");
  fault(60, "x", "luminous intensity 1: is 'x'");
}

TEST_CASE("luminaire: a file that ends anywhere is refused, or is whole but for its last number") {
  const std::string ies = ies_text({0, 45, 90}, {0, 90}, lambertian);
  const std::string ldt = ldt_text(4, 4, {0, 45, 90}, lambertian);
  for (const auto& [name, text] : {std::pair(std::string("a.ies"), ies), std::pair(std::string("a.ldt"), ldt)}) {
    const std::size_t last = text.find_last_of(", \n", text.find_last_not_of(",\n"));
    for (std::size_t bytes = 1; bytes < text.size(); ++bytes) {
      const auto l = read_luminaire_text(name, text.substr(0, bytes));
      CHECK((!l.ok() || bytes > last + 1));
      if (!l.ok()) CHECK(l.error().line().find("expected") != std::string::npos);
    }
  }
}

TEST_CASE("luminaire: random changes of bytes never give a table that is not valid") {
  const std::string texts[] = {ies_text({0, 45, 90}, {0, 90}, lambertian), ldt_text(3, 8, {0, 45, 90}, lambertian)};
  const std::string alphabet = "0123456789.,-+ \n\rexnIT=\xFF";
  for (std::uint32_t trial = 0; trial < 1500; ++trial) {
    RandomStream random(5, RandomPurpose::test, 0, 0, trial, 0);
    std::string text = texts[trial % 2];
    for (std::uint32_t i = 0; i <= trial % 4; ++i) {
      text[random.next_u32() % text.size()] = alphabet[random.next_u32() % alphabet.size()];
    }
    const auto l = trial % 2 == 0 ? io::detail::parse_ies("a.ies", text, 0) : io::detail::parse_eulumdat("a", text, 0);
    if (!l.ok()) continue;
    CHECK(validate(l.value().table).ok());
    CHECK(std::isfinite(candela_at(l.value(), 33, 44)));
    CHECK(l.value().relative.size() <= 16 * 3);
  }
}
