// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "angio/base/big_endian.hpp"
#include "description.hpp"

// A message's fields to bytes and back, as LCM lays them out: one after the other, big-endian, without padding.
namespace angio::messaging::wire {

/// Visits a message's fields and appends them to bytes. Asks for no rule.
class FieldWriter {
 public:
  /// Appends to `bytes`, which are borrowed.
  explicit FieldWriter(std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}

  template <typename Number>
  void number(const char*, const Number& value, const Limits& = {}) {
    put(value);
  }
  template <typename Values>
  void array(const char*, const Values& values, ArrayRule = ArrayRule::kNone) {
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      for (Eigen::Index c = 0; c < values.cols(); ++c) put(double{values(r, c)});
    }
  }
  template <typename T>
  void message(const char*, const T& m) {
    Description<T>::fields(*this, m);
  }
  void text(const char*, const std::string& text) {
    put(static_cast<std::int32_t>(text.size() + 1));  // LCM counts the closing NUL.
    bytes_.insert(bytes_.end(), text.c_str(), text.c_str() + text.size() + 1);
  }
  void bytes(const char*, std::int32_t size, const char*, const std::vector<std::uint8_t>& bytes) {
    put(size);
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  template <int Rows, typename Rule>
  void columns(const char*, const char*, const Columns<Rows>& values, const Rule&) {
    put(static_cast<std::int32_t>(values.cols()));
    for (Eigen::Index i = 0; i < values.size(); ++i) put(values.data()[i]);
  }

 private:
  template <typename Value>
  void put(const Value& value) {
    static_assert(sizeof(BitsOf<Value>) == sizeof(Value), "no type of LCM's has this size");
    BitsOf<Value> bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (std::size_t i = sizeof bits; i-- > 0;) bytes_.push_back(static_cast<std::uint8_t>(bits >> (8 * i)));
  }

  std::vector<std::uint8_t>& bytes_;
};

/// Visits a message's fields and fills them from bytes that may come from anywhere; never reads beyond them, and
/// allocates no more than they are.
class FieldReader {
 public:
  /// Borrows the bytes.
  FieldReader(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}

  /// What is wrong with the bytes once all fields were visited, or null.
  const char* broken() const { return broken_ || left_ == 0 ? broken_ : "bytes behind its end"; }

  template <typename Number>
  void number(const char*, Number& value, const Limits& = {}) {
    get(value);
  }
  template <typename Values>
  void array(const char*, Values&& values, ArrayRule = ArrayRule::kNone) {
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      for (Eigen::Index c = 0; c < values.cols(); ++c) get(values(r, c));
    }
  }
  template <typename T>
  void message(const char*, T& m) {
    Description<T>::fields(*this, m);
  }
  // What has a variable length stands last, so that its length field must name all bytes that are left.
  void text(const char*, std::string& text) {
    std::int32_t size = 0;
    if (left_ < 5) fail("truncated");
    get(size);
    if (size < 1 || static_cast<std::size_t>(size) != left_) fail("its text length is not the number of its bytes");
    if (!broken_ && at_[left_ - 1] != 0) fail("its text does not end in NUL");
    if (broken_) return;
    text.assign(reinterpret_cast<const char*>(at_), left_ - 1);
    left_ = 0;
  }
  void bytes(const char*, std::int32_t& size, const char*, std::vector<std::uint8_t>& bytes) {
    get(size);
    if (size < 0 || static_cast<std::size_t>(size) != left_) fail("its size field is not the number of its bytes");
    if (broken_) return;
    bytes.assign(at_, at_ + left_);
    left_ = 0;
  }
  template <int Rows, typename Rule>
  void columns(const char*, const char*, Columns<Rows>& values, const Rule&) {
    std::int32_t count = 0;
    get(count);
    if (count < 0 || static_cast<std::size_t>(count) * Rows * sizeof(float) != left_) {
      fail("its number of points is not that of its bytes");
    }
    if (broken_) return;
    values.resize(Rows, count);
    for (Eigen::Index i = 0; i < values.size(); ++i) get(values.data()[i]);
  }

 private:
  void fail(const char* rule) {
    if (!broken_) broken_ = rule;
  }

  template <typename Value>
  void get(Value& value) {
    if (left_ < sizeof value) fail("truncated");
    if (broken_) return;
    value = bigEndian<Value>(at_);
    at_ += sizeof value;
    left_ -= sizeof value;
  }

  const std::uint8_t* at_;
  std::size_t left_;
  const char* broken_ = nullptr;
};

}  // namespace angio::messaging::wire
