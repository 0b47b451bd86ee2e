// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Bytes and texts of the devices, and the inputs that fuzzing kept.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "../fuzz/targets.cpp"
#include "assembly_cell/sensor/devices/iio_text.h"
#include "assembly_cell/sensor/devices/netft_configuration.h"
#include "assembly_cell/sensor/devices/serial_frame.h"

namespace assembly_cell {
namespace {

const std::uint8_t* bytesOf(const char* text) {
  return reinterpret_cast<const std::uint8_t*>(text);
}

TEST(SerialFrame, ChecksumsHaveTheirCatalogueValues) {
  // the check values of both CRCs: of the nine digits
  EXPECT_EQ(crcX25(bytesOf("123456789"), 9), 0x906e);
  EXPECT_EQ(crcModbus(bytesOf("123456789"), 9), 0x4b37);
}

TEST(SerialFrame, BotaFramesHaveTheDocumentedBytes) {
  SerialFrame frame;
  frame.status = 0x0201;
  frame.values = {1.0, -2.0, 0.5, 0.0, 100.0, -0.125};
  frame.timestamp = 0x04030201;
  frame.temperature = 25.5;
  const auto bytes = packBotaFrame(frame);
  const std::vector<std::uint8_t> expected = {0xaa, 0x01, 0x02, 0x00, 0x00, 0x80, 0x3f, 0x00, 0x00,
                                              0x00, 0xc0, 0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x00,
                                              0x00, 0x00, 0x00, 0xc8, 0x42, 0x00, 0x00, 0x00, 0xbe,
                                              0x01, 0x02, 0x03, 0x04, 0x00, 0x00, 0xcc, 0x41};
  ASSERT_EQ(bytes.size(), kBotaSize);
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), bytes.begin()));
  const std::uint16_t crc = crcX25(bytes.data() + 1, 34);
  EXPECT_EQ(bytes[35], crc & 0xff);
  EXPECT_EQ(bytes[36], crc >> 8);
  SerialFrame back;
  ASSERT_TRUE(kBotaFormat.intact(bytes.data()) && kBotaFormat.decode(bytes.data(), back));
  EXPECT_EQ(back.values, frame.values);
  EXPECT_EQ(back.timestamp, frame.timestamp);
  EXPECT_EQ(back.temperature, 25.5);
}

TEST(SerialFrame, RobotiqFramesHaveTheDocumentedBytes) {
  SerialFrame frame;
  frame.values = {1.23, -0.01, 327.67, 0.001, -1.0, 0.0};
  const auto bytes = packRobotiqFrame(frame);
  const std::vector<std::uint8_t> expected = {0x20, 0x4e, 0x7b, 0x00, 0xff, 0xff, 0xff,
                                              0x7f, 0x01, 0x00, 0x18, 0xfc, 0x00, 0x00};
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), bytes.begin()));
  SerialFrame back;
  ASSERT_TRUE(kRobotiqFormat.intact(bytes.data()) && kRobotiqFormat.decode(bytes.data(), back));
  EXPECT_EQ(back.saturated, 1u << 2);
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(back.values[k], frame.values[k], 1e-12);
}

TEST(FrameDecoder, FindsEveryFrameWhateverItsBytesAreSplitInto) {
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < 20; ++i) {
    SerialFrame frame;
    // payloads full of headers
    std::uint32_t header = 0xaaaaaaaa;
    float value = 0.0f;
    std::memcpy(&value, &header, sizeof value);
    frame.values.fill(static_cast<double>(value));
    frame.timestamp = static_cast<std::uint32_t>(i) * 0xaa;
    frame.temperature = static_cast<double>(value);
    const auto packed = packBotaFrame(frame);
    bytes.insert(bytes.end(), packed.begin(), packed.end());
  }
  bytes.push_back(0xaa);
  for (std::size_t piece = 1; piece <= 2 * kBotaSize; ++piece) {
    const auto decoder = std::make_unique<FrameDecoder>(kBotaFormat);
    SourceCounters counters;
    SerialFrame frame;
    std::uint32_t frames = 0;
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      const std::size_t n = std::min(piece, bytes.size() - at);
      std::copy_n(bytes.data() + at, n, decoder->space());
      decoder->added(n);
      while (decoder->next(frame, counters)) EXPECT_EQ(frame.timestamp, frames++ * 0xaa);
    }
    EXPECT_EQ(frames, 20u) << piece;
    EXPECT_EQ(counters.crc_errors + counters.garbage, 0u);
  }
}

TEST(FrameDecoder, NoBitErrorPasses) {
  std::vector<std::uint8_t> good;
  for (int i = 0; i < 5; ++i) {
    SerialFrame frame;
    frame.timestamp = static_cast<std::uint32_t>(i);
    const auto packed = packBotaFrame(frame);
    good.insert(good.end(), packed.begin(), packed.end());
  }
  good.push_back(0xaa);
  // each single bit of the third, to which the decoder comes in step
  for (std::size_t bit = 16 * kBotaSize; bit < 24 * kBotaSize; ++bit) {
    std::vector<std::uint8_t> bytes = good;
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1u << bit % 8);
    const auto decoder = std::make_unique<FrameDecoder>(kBotaFormat);
    std::copy(bytes.begin(), bytes.end(), decoder->space());
    decoder->added(bytes.size());
    SourceCounters counters;
    SerialFrame frame;
    std::vector<std::uint32_t> stamps;
    while (decoder->next(frame, counters)) stamps.push_back(frame.timestamp);
    EXPECT_EQ(stamps, (std::vector<std::uint32_t>{0, 1, 3, 4})) << bit;
    EXPECT_EQ(counters.garbage, kBotaSize);
    EXPECT_EQ(counters.crc_errors, bit / 8 == 2 * kBotaSize ? 0u : 1u);
  }
}

std::string document(const std::string& force, const std::string& torque,
                     const std::string& counts = "1000000") {
  return "<?xml version=\"1.0\"?>\n<netft>\n<cfgcpf>" + counts +
         "</cfgcpf><cfgcpt> 2000000 </cfgcpt>\n<scfgfu>" + force + "</scfgfu><scfgtu>" + torque +
         "</scfgtu><comrdte>1</comrdte><comrdtrate>7000</comrdtrate></netft>";
}

TEST(NetftConfiguration, ReadsTheBoxesUnits) {
  struct Case {
    const char *force, *torque;
    double newtons, newton_metres;
  };
  // pound 0.45359237 kg, inch 25.4 mm, g 9.80665 m/s²: exact by definition
  const double lbf = 0.45359237 * 9.80665;
  for (const Case& c :
       {Case{"N", "N-m", 1.0, 1.0}, Case{"N", "Nm", 1.0, 1.0}, Case{"kN", "kN-m", 1e3, 1e3},
        Case{"N", "N-mm", 1.0, 1e-3}, Case{"lbf", "lbf-in", lbf, lbf * 0.0254},
        Case{"klbf", "lbf-ft", 1e3 * lbf, lbf * 0.3048}, Case{"kg", "kg-cm", 9.80665, 0.0980665},
        Case{"g", "N m", 9.80665e-3, 1.0}}) {
    const NetftConfiguration read = parseNetftConfiguration(document(c.force, c.torque));
    const NetftScale scale = netftScale(read);
    EXPECT_NEAR(scale.force, c.newtons / 1e6, 1e-15 * c.newtons) << c.force;
    EXPECT_NEAR(scale.torque, c.newton_metres / 2e6, 1e-15 * c.newton_metres) << c.torque;
    EXPECT_FALSE(scale.volts);
    EXPECT_EQ(read.rate, 7000.0);
    EXPECT_TRUE(read.rdt_enabled);
  }
  EXPECT_TRUE(netftScale(parseNetftConfiguration(document("V", "V"))).volts);
}

TEST(NetftConfiguration, RefusesWhatItDoesNotKnow) {
  for (const char* unit : {"", "strain", "Mn", "N-m", "pounds", "<N>"}) {
    EXPECT_THROW(netftScale(parseNetftConfiguration(document(unit, "Nm"))), SourceError) << unit;
  }
  EXPECT_THROW(netftScale(parseNetftConfiguration(document("N", "N"))), SourceError);
  EXPECT_THROW(netftScale(parseNetftConfiguration(document("V", "Nm"))), SourceError);
  for (const char* counts : {"0", "-1", "nan", "inf", "1e99", "many", ""}) {
    EXPECT_THROW(parseNetftConfiguration(document("N", "Nm", counts)), SourceError) << counts;
  }
  EXPECT_THROW(parseNetftConfiguration(""), SourceError);
  EXPECT_THROW(parseNetftConfiguration("<cfgcpf>1"), SourceError);
}

TEST(NetftConfiguration, TakesAWholeAnswerOnly) {
  EXPECT_EQ(httpBody("HTTP/1.0 200 OK\r\nContent-Length: 3\r\n\r\nabcd"), "abc");
  EXPECT_EQ(httpBody("HTTP/1.1 200\r\n\r\nabc"), "abc");
  EXPECT_TRUE(httpComplete("HTTP/1.0 200 OK\r\nCONTENT-LENGTH: 3\r\n\r\nabc"));
  EXPECT_FALSE(httpComplete("HTTP/1.0 200 OK\r\nContent-Length: 4\r\n\r\nabc"));
  EXPECT_FALSE(httpComplete("HTTP/1.0 200 OK\r\n\r\nabc"));
  for (const char* bad : {"", "HTTP/1.0 404 Not Found\r\n\r\n", "HTTP/1.0 2000\r\n\r\n",
                          "HTTP/1.0 200 OK\r\nContent-Length: 4\r\n\r\nabc", "HTTP/1.0 200 OK\r\n",
                          "220 ftp ready\r\n\r\n"}) {
    EXPECT_THROW(httpBody(bad), SourceError) << bad;
  }
}

TEST(IioText, ReadsWhatTheKernelWrites) {
  double number = 0.0;
  EXPECT_TRUE(parseIioNumber("0.000298023\n", number));
  EXPECT_EQ(number, 0.000298023);
  EXPECT_TRUE(parseIioNumber("-3.5 dB\n", number));
  EXPECT_EQ(number, -3.5);
  for (const char* bad :
       {"", "\n", "-", "+-1", "1 2", "nan", "inf", "1e999", "0x10", "12a", " dB"}) {
    EXPECT_FALSE(parseIioNumber(bad, number)) << bad;
  }
  std::int64_t code = 0;
  EXPECT_TRUE(parseIioInteger("-8388608\n", code));
  EXPECT_EQ(code, -8388608);
  for (const char* bad : {"", "1.0", "99999999999999999999", "1,2", "--1"}) {
    EXPECT_FALSE(parseIioInteger(bad, code)) << bad;
  }
  EXPECT_FALSE(parseIioInteger(std::string(100, '1'), code));
}

TEST(IioText, TakesTypesAndTheirEndCodes) {
  IioType type;
  ASSERT_TRUE(parseIioType("be:s24/32>>8\n", type));
  EXPECT_EQ(type.bits, 24u);
  ASSERT_TRUE(parseIioType("le:u12/16>>4", type));
  EXPECT_TRUE(isIioEndCode(0xfff, type));
  EXPECT_TRUE(isIioEndCode(0, type));
  EXPECT_FALSE(isIioEndCode(1, type));
  ASSERT_TRUE(parseIioType("le:s64/64>>0", type));
  for (const char* bad :
       {"", "le", "le:s24/24>>0", "le:s0/16>>0", "le:s16/16>>1", "le:x16/16>>0", "le:s16/16X2>>0",
        "le:s17/16>>0", "le:s16/16>>0 ", "le:s8/16>>99999999999"}) {
    const bool blank = std::string(bad) == "le:s16/16>>0 ";  // blanks around it are fine
    EXPECT_EQ(parseIioType(bad, type), blank) << bad;
  }
}

// The corpora of test/fuzz, as they are kept.
TEST(Fuzz, KeptInputsBreakNothing) {
  struct Target {
    const char* name;
    void (*run)(const std::uint8_t*, std::size_t);
  };
  for (const Target& target :
       {Target{"RdtRecord", fuzzRdtRecord}, Target{"NetftConfiguration", fuzzNetftConfiguration},
        Target{"BotaFrames", fuzzBotaFrames}, Target{"RobotiqFrames", fuzzRobotiqFrames},
        Target{"Replay", fuzzReplay}, Target{"IioText", fuzzIioText},
        Target{"MessageCheck", fuzzMessageCheck}, Target{"PlantGuard", fuzzPlantGuard}}) {
    std::size_t inputs = 0;
    const std::string folder =
        std::string(ASSEMBLY_CELL_SOURCE_DIR "/test/fuzz/corpus/") + target.name;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      std::ifstream file(entry.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(file), {}};
      ++inputs;
      // each beginning of it too
      for (std::size_t size = 0; size <= bytes.size(); ++size)
        target.run(bytesOf(bytes.data()), size);
    }
    EXPECT_GT(inputs, 0u) << target.name;
  }
}

}  // namespace
}  // namespace assembly_cell
