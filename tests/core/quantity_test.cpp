#include "tunica/core/quantity.hpp"

#include "tunica/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

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

TEST(Quantity, Tolerances) {
  EXPECT_DOUBLE_EQ(parse_length_tolerance("0.5%").millimetres(200), 1);
  EXPECT_DOUBLE_EQ(parse_length_tolerance("0.2mm").millimetres(200), 0.2);
  for (const char* text : {"0.5", "0%", "-1mm", "0mm", "5", "%", "1kPa", "nan%"}) {
    EXPECT_THROW(parse_length_tolerance(text), UsageError) << text;
  }
}

}  // namespace
}  // namespace tunica
