// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "async_requests.h"

#include <exception>
#include <utility>
#include <vector>

namespace assembly_cell::panel {

AsyncRequests::~AsyncRequests() {
  std::vector<Abandon> abandons;
  std::vector<std::thread> threads;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [name, request] : requests_) {
      if (request.running && request.abandon) abandons.push_back(request.abandon);
      threads.push_back(std::move(request.thread));
    }
  }
  for (const Abandon& abandon : abandons) abandon();
  for (std::thread& thread : threads) {
    if (thread.joinable()) thread.join();
  }
}

bool AsyncRequests::start(const std::string& name, Work work, Abandon abandon, bool quiet) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Request& request = requests_[name];
  if (request.thread.joinable()) {
    if (request.running) return false;
    request.thread.join();
  }
  request.abandon = std::move(abandon);
  request.running = true;
  request.abandoned = false;
  request.since = Clock::now();
  if (!quiet) answers_[name] = {Answer::State::kWaiting, "", request.since, ++count_};
  request.thread = std::thread([this, name, quiet, run = std::move(work)] {
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
    requests_[name].running = false;
  });
  return true;
}

void AsyncRequests::abandonAfter(std::chrono::seconds timeout) {
  std::vector<Abandon> abandons;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [name, request] : requests_) {
      const bool late = request.running && Clock::now() - request.since > timeout;
      if (!late || request.abandoned || !request.abandon) continue;
      request.abandoned = true;
      abandons.push_back(request.abandon);
    }
  }
  for (const Abandon& abandon : abandons) abandon();
}

std::map<std::string, Answer> AsyncRequests::answers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return answers_;
}

}  // namespace assembly_cell::panel
