#include "tunica/core/quantity.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/spelling.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

TEST(Quantity, EveryUnitOfTheContract) {
  const auto same = [](const char* a, const char* b, Dimension d) {
    EXPECT_NEAR(parse_quantity(a, d) / parse_quantity(b, d), 1, 1e-9) << a << " against " << b;
  };
  same("1000um", "1mm", dimension::length);
  same("10mm", "1cm", dimension::length);
  same("100 cm", "1m", dimension::length);
  same("1000Pa", "1kPa", dimension::pressure);
  same("1000kPa", "1MPa", dimension::pressure);
  same("1000MPa", "1GPa", dimension::pressure);
  same("1mmHg", "133.322387415Pa", dimension::pressure);
  same("1cmH2O", "98.0665Pa", dimension::pressure);
  same("1bar", "1e5Pa", dimension::pressure);
  same("1N/mm2", "1MPa", dimension::pressure);
  same("1dyn/cm2", "0.1Pa", dimension::pressure);
  same("1psi", "6894.757293168Pa", dimension::pressure);
  same("760Torr", "101325Pa", dimension::pressure);
  same("1mbar", "100Pa", dimension::pressure);
  same("1hPa", "100Pa", dimension::pressure);
  same("1ml", "1000mm3", dimension::volume);
  same("1cm3", "1000mm3", dimension::volume);
  same("1l", "1000cm3", dimension::volume);
  same("1.1kg/l", "1.1g/cm3", dimension::density);
  same("1e6uN", "1N", dimension::force);
  same("1e3mN", "1N", dimension::force);
  same("1kN", "1000N", dimension::force);
  same("1N*m", "1000N*mm", dimension::moment);
  same("1N/m", "0.001N/mm", dimension::force_per_length);
  same("1e6us", "1s", dimension::time);
  same("1000ms", "1s", dimension::time);
  same("1min", "60s", dimension::time);
  same("1100kg/m3", "1.1g/cm3", dimension::density);
  same("1.1e-3g/mm3", "1.1g/cm3", dimension::density);
  same("1t/mm3", "1e12kg/m3", dimension::density);
  same("9.81m/s2", "9810mm/s2", dimension::acceleration);
  same("9.81m*s^-2", "9810mm/s2", dimension::acceleration);
  same("0.1/s", "6/min", dimension::rate);
}

TEST(Quantity, InternalUnitsAreMillimetreNewtonSecond) {
  EXPECT_DOUBLE_EQ(parse_quantity("-90 MPa", dimension::pressure), -90);
  EXPECT_DOUBLE_EQ(parse_quantity("2.5e-07N", dimension::force), 2.5e-7);
  EXPECT_NEAR(parse_quantity("1100kg/m3", dimension::density), 1.1e-9, 1e-22);
  EXPECT_DOUBLE_EQ(parse_quantity("40ms", dimension::time), 0.04);
}

TEST(Quantity, ABareNumberIsToldTheRightSpelling) {
  try {
    parse_quantity("1000", dimension::pressure);
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("1000kPa"));
  }
}

TEST(Quantity, WhatIsNotAQuantityIsRefused) {
  for (const char* text : {"", " ", "kPa", "1 kpa", "1kPa kPa", "nankPa", "infPa", "0x10Pa", "1e999Pa", "1kPa*", "1mm",
                           "1Pa0", "--1Pa", "+-1Pa", "1kPa/", "1kPax", "1e308GPa", "1,5kPa"}) {
    EXPECT_THROW(parse_quantity(text, dimension::pressure), UsageError) << text;
  }
}

std::string refusal(std::string_view text, Dimension dimension) {
  try {
    (void)parse_quantity(text, dimension);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Quantity, WhatPeopleWriteGetsTheNearestRightSpelling) {
  struct Slip {
    const char* text;
    Dimension dimension;
    const char* right;
  };
  for (const Slip& slip : {Slip{"120mmhg", dimension::pressure, "120mmHg"},
                           {"120 mm Hg", dimension::pressure, "120mmHg"},
                           {"120MMHG", dimension::pressure, "120mmHg"},
                           {"120 mm", dimension::pressure, "120mmHg"},
                           {"10cmH20", dimension::pressure, "10cmH2O"},
                           {"10 cmH\u2082O", dimension::pressure, "10cmH2O"},
                           {"16KPA", dimension::pressure, "16kPa"},
                           {"2 kilopascals", dimension::pressure, "2kPa"},
                           {"1.2Mpa", dimension::pressure, "1.2MPa"},
                           {"1.2MPA", dimension::pressure, "1.2MPa"},
                           {"2PSI", dimension::pressure, "2psi"},
                           {"2torr", dimension::pressure, "2Torr"},
                           {"5 dynes/cm\u00b2", dimension::pressure, "5dyn/cm2"},
                           {"5 N per mm2", dimension::pressure, "5N/mm2"},
                           {"1,5kPa", dimension::pressure, "1.5kPa"},
                           {"1,5", dimension::pressure, "1.5kPa"},
                           {"-2,5e3Pa", dimension::pressure, "-2.5e3Pa"},
                           {"1.000,5 Pa", dimension::pressure, "1000.5Pa"},
                           {"15 998 Pa", dimension::pressure, "15998Pa"},
                           {"1.5MM", dimension::length, "1.5mm"},
                           {"1,5 Mm", dimension::length, "1.5mm"},
                           {",5mm", dimension::length, "0.5mm"},
                           {"300\u00b5m", dimension::length, "300um"},
                           {"300 microns", dimension::length, "300um"},
                           {"1.1 g/cm\u00b3", dimension::density, "1.1g/cm3"},
                           {"1.1 g/cc", dimension::density, "1.1g/ml"},
                           {"1100KG/M3", dimension::density, "1100kg/m3"},
                           {"1100kg", dimension::density, "1100kg/m3"},
                           {"10 milliseconds", dimension::time, "10ms"},
                           {"10 MSEC", dimension::time, "10ms"},
                           {"400 mL", dimension::volume, "400ml"}}) {
    const std::string said = refusal(slip.text, slip.dimension);
    EXPECT_THAT(said, EndsWith(std::string(": write ") + slip.right)) << slip.text;
    EXPECT_NO_THROW(parse_quantity(slip.right, slip.dimension)) << slip.right;
  }
  EXPECT_THAT(refusal("5xyz", dimension::pressure), HasSubstr("kPa, Pa, hPa, MPa, GPa, mmHg, cmH2O"));
  EXPECT_THAT(refusal("5xPa", dimension::pressure), HasSubstr("units of pressure are")) << "more than one is near";
  EXPECT_THAT(refusal("12.5.3kPa", dimension::pressure), testing::Not(HasSubstr("write 1253")));
  EXPECT_THAT(refusal("1,25,3kPa", dimension::pressure), testing::Not(HasSubstr("write 1253")));
  EXPECT_THAT(refusal("1.250.300Pa", dimension::pressure), EndsWith("write 1250300Pa"));
  EXPECT_THAT(refusal("5ms", dimension::length), HasSubstr("is a time, not a length: units of length are"));
  EXPECT_THAT(refusal("5e400kPa", dimension::pressure), HasSubstr("is not a pressure"));
}

// A unit of its own keeps what it says: it is told in one that is read, and never as one whose name is near.
TEST(Quantity, OtherUnitsAreToldInThoseThatAreRead) {
  struct Other {
    const char* text;
    Dimension dimension;
    const char* right;
  };
  for (const Other& other : {Other{"5atm", dimension::pressure, "506.625kPa"},
                             {"10000Ba", dimension::pressure, "1000Pa"},
                             {"1daN/cm2", dimension::pressure, "10N/cm2"},
                             {"7.5mHg", dimension::pressure, "7500mmHg"},
                             {"10mmH2O", dimension::pressure, "1cmH2O"},
                             {"1ksi", dimension::pressure, "1000psi"},
                             {"0.1kgf/cm2", dimension::pressure, "0.980665N/cm2"},
                             {"1.1Mg/m3", dimension::density, "1.1t/m3"},
                             {"1.1kg/dm3", dimension::density, "1.1e-06kg/mm3"},
                             {"1000000nm", dimension::length, "1000um"},
                             {"0.04in", dimension::length, "1.016mm"}}) {
    EXPECT_THAT(refusal(other.text, other.dimension), EndsWith(std::string(": write ") + other.right));
    EXPECT_NO_THROW(parse_quantity(other.right, other.dimension)) << other.right;
  }
  EXPECT_THAT(refusal("0x10Pa", dimension::pressure), testing::Not(HasSubstr("example 0")));
}

TEST(Quantity, WhatHasTwoMeaningsIsToldBoth) {
  EXPECT_THAT(refusal("3mpa", dimension::pressure), EndsWith("write 3MPa (megapascal) or 0.003Pa (millipascal)"));
  EXPECT_THAT(refusal("3MBar", dimension::pressure), EndsWith("write 3mbar (millibar) or 300000MPa (megabar)"));
  EXPECT_THAT(refusal("3mBar", dimension::pressure), EndsWith("write 3mbar"));
  EXPECT_THAT(refusal("3 mPa", dimension::pressure), EndsWith("write 3MPa (megapascal) or 0.003Pa (millipascal)"));
  EXPECT_THAT(refusal("2MN", dimension::force), EndsWith("write 2mN (millinewton) or 2000kN (meganewton)"));
  EXPECT_THAT(refusal("1,000mm", dimension::length),
              EndsWith("write 1000mm (the comma groups thousands) or 1.000mm (the comma is decimal)"));
}

TEST(Quantity, PercentagesAreWrittenWithTwoDigitsAndNeverAsPowers) {
  for (const auto& [part, text] : {std::pair(0.01234, "1.2 %"), {0.994, "99 %"}, {0.996, "100 %"}, {12.3, "1230 %"}}) {
    EXPECT_EQ(percent_text(part), text);
  }
}

TEST(Quantity, NumbersAndPercentagesWithACommaToo) {
  EXPECT_THAT(right_numbers("0,45"), testing::ElementsAre("0.45"));
  EXPECT_TRUE(right_numbers("half").empty());
  EXPECT_THROW(
      {
        try {
          (void)parse_length_tolerance("0,5%");
        } catch (const UsageError& error) {
          EXPECT_THAT(error.what(), EndsWith("write 0.5%"));
          throw;
        }
      },
      UsageError);
}

TEST(Quantity, UnitsOfMeshesToo) {
  try {
    (void)parse_length_unit("MM");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), EndsWith("write mm"));
  }
}

TEST(Quantity, Tolerances) {
  EXPECT_DOUBLE_EQ(parse_length_tolerance("0.5%").millimetres(200), 1);
  EXPECT_DOUBLE_EQ(parse_length_tolerance("0.2mm").millimetres(200), 0.2);
  for (const char* text : {"0.5", "0%", "-1mm", "0mm", "5", "%", "1kPa", "nan%"}) {
    EXPECT_THROW(parse_length_tolerance(text), UsageError) << text;
  }
}

}  // namespace
}  // namespace tunica
