// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "errands.h"

#include <exception>
#include <utility>
#include <vector>

namespace assembly_cell::panel {

Errands::~Errands() {
  std::vector<Abandon> abandons;
  std::vector<std::thread> threads;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [name, errand] : errands_) {
      if (errand.running && errand.abandon) abandons.push_back(errand.abandon);
      threads.push_back(std::move(errand.thread));
    }
  }
  for (const Abandon& abandon : abandons) abandon();
  for (std::thread& thread : threads) {
    if (thread.joinable()) thread.join();
  }
}

bool Errands::begin(const std::string& name, Work work, Abandon abandon, bool quiet) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Errand& errand = errands_[name];
  if (errand.thread.joinable()) {
    if (errand.running) return false;
    errand.thread.join();
  }
  errand.abandon = std::move(abandon);
  errand.running = true;
  errand.abandoned = false;
  errand.since = Clock::now();
  if (!quiet) answers_[name] = {Answer::State::kWaiting, "", errand.since, ++count_};
  errand.thread = std::thread([this, name, quiet, run = std::move(work)] {
    Answer answer;
    try {
      answer = run();
    } catch (const std::exception& error) {
      answer.state = Answer::State::kBad;
      answer.text = error.what();
    }
    const std::lock_guard<std::mutex> end(mutex_);
    answer.since = Clock::now();
    answer.number = ++count_;
    if (!quiet) answers_[name] = answer;
    errands_[name].running = false;
  });
  return true;
}

bool Errands::running(const std::string& name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = errands_.find(name);
  return found != errands_.end() && found->second.running;
}

void Errands::abandonAfter(std::chrono::seconds patience) {
  std::vector<Abandon> abandons;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [name, errand] : errands_) {
      const bool late = errand.running && Clock::now() - errand.since > patience;
      if (!late || errand.abandoned || !errand.abandon) continue;
      errand.abandoned = true;
      abandons.push_back(errand.abandon);
    }
  }
  for (const Abandon& abandon : abandons) abandon();
}

std::map<std::string, Answer> Errands::answers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return answers_;
}

}  // namespace assembly_cell::panel
