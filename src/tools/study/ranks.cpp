// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "ranks.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <thread>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr int kRecords = 1, kTasks = 2;  // message tags
// between looks for a message: rank 0 shares its core with a worker, and while ranks have a block
// no rank waits for it; the others have nothing else to do
constexpr std::chrono::microseconds kLongNap(5000), kShortNap(1000), kWorkerNap(200);
constexpr double kBlockTime = 0.1;  // duration of a block of runs [s]
constexpr std::size_t kBlocks = 2;  // blocks of a rank: at work and waiting
constexpr std::int64_t kLargestBlock = 4096;

std::string receiveFrom(const MPI_Status& status) {
  int size = 0;
  MPI_Get_count(&status, MPI_CHAR, &size);
  std::string text(static_cast<std::size_t>(size), '\0');
  MPI_Recv(&text[0], size, MPI_CHAR, status.MPI_SOURCE, status.MPI_TAG, MPI_COMM_WORLD,
           MPI_STATUS_IGNORE);
  return text;
}

void sendTo(int rank, int tag, const std::string& text) {
  MPI_Send(text.data(), static_cast<int>(text.size()), MPI_CHAR, rank, tag, MPI_COMM_WORLD);
}

// tasks as bytes: run, size of the point, point; again and again
std::string packTasks(const std::vector<StudyTask>& tasks) {
  std::string bytes;
  const auto put = [&bytes](const void* data, std::size_t size) {
    bytes.append(static_cast<const char*>(data), size);
  };
  for (const StudyTask& task : tasks) {
    const auto size = static_cast<std::int64_t>(task.point.size());
    put(&task.run, sizeof task.run);
    put(&size, sizeof size);
    put(task.point.data(), task.point.size() * sizeof(double));
  }
  return bytes;
}

std::vector<StudyTask> unpackTasks(const std::string& bytes) {
  std::vector<StudyTask> tasks;
  std::size_t at = 0;
  const auto get = [&](void* data, std::size_t size) {
    std::memcpy(data, bytes.data() + at, size);
    at += size;
  };
  while (at < bytes.size()) {
    StudyTask task;
    std::int64_t size = 0;
    get(&task.run, sizeof task.run);
    get(&size, sizeof size);
    task.point.resize(static_cast<std::size_t>(size));
    if (size > 0) get(task.point.data(), task.point.size() * sizeof(double));
    tasks.push_back(task);
  }
  return tasks;
}

}  // namespace

bool Ranks::launched() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

Ranks::Ranks() {
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  peers_.resize(static_cast<std::size_t>(size_));
}

Ranks::~Ranks() { MPI_Finalize(); }

bool Ranks::agree(const std::string& text, bool good) const {
  std::string mine = (good ? "good " : "bad ") + crcText(text);
  mine.resize(32, ' ');
  std::string all(mine.size() * static_cast<std::size_t>(size_), ' ');
  MPI_Allgather(mine.data(), 32, MPI_CHAR, &all[0], 32, MPI_CHAR, MPI_COMM_WORLD);
  for (std::size_t i = 0; i < all.size(); i += mine.size()) {
    if (all.compare(i, mine.size(), all, 0, mine.size()) != 0) return false;
  }
  return all.compare(0, 4, "good") == 0;
}

void Ranks::receive(StudyLedger& ledger, std::atomic<bool>& stop, bool& any) {
  int there = 0;
  MPI_Status status;
  while (MPI_Iprobe(MPI_ANY_SOURCE, kRecords, MPI_COMM_WORLD, &there, &status) == MPI_SUCCESS &&
         there != 0) {
    any = true;
    const std::string text = receiveFrom(status);
    Peer& peer = peers_[static_cast<std::size_t>(status.MPI_SOURCE)];
    // done with the block before anything can throw: release() waits for those that are out
    const std::int64_t runs = peer.blocks.front().runs;
    MPI_Wait(&peer.blocks.front().request, MPI_STATUS_IGNORE);
    peer.blocks.pop_front();
    std::size_t at = 0;
    std::int64_t count = 0;
    StudyRecord record;
    while (const std::size_t taken = decodeRecord(text.data() + at, text.size() - at, record)) {
      ledger.put(record);
      at += taken;
      ++count;
    }
    if (count < runs) stop = true;
    const double now = MPI_Wtime();
    if (count > 0) peer.run_time = (now - peer.since) / static_cast<double>(count);
    peer.since = now;
  }
}

// Blocks take about the same time, and get smaller when little is left; then nothing waits in line.
void Ranks::handOut(StudyLedger& ledger, int threads) {
  for (std::size_t line = 0; line < kBlocks; ++line) {
    for (std::size_t i = 1; i < peers_.size(); ++i) {
      Peer& peer = peers_[i];
      if (peer.blocks.size() > line) continue;
      const std::int64_t fair = ledger.waiting() / (2 * size_);
      if (line > 0 && fair < threads) return;
      const auto wanted = peer.run_time > 0.0
                              ? static_cast<std::int64_t>(kBlockTime * threads / peer.run_time)
                              : threads;
      const std::int64_t size =
          std::min(kLargestBlock, std::max<std::int64_t>(threads, std::min(wanted, fair)));
      std::vector<StudyTask> tasks;
      StudyTask task;
      while (static_cast<std::int64_t>(tasks.size()) < size && ledger.take(task)) {
        tasks.push_back(task);
      }
      if (tasks.empty()) return;
      if (peer.blocks.empty()) peer.since = MPI_Wtime();
      peer.blocks.push_back(
          {static_cast<std::int64_t>(tasks.size()), packTasks(tasks), MPI_REQUEST_NULL});
      Block& block = peer.blocks.back();
      // never waits: the rank may be at work, or waiting until its records are taken
      MPI_Isend(block.bytes.data(), static_cast<int>(block.bytes.size()), MPI_CHAR,
                static_cast<int>(i), kTasks, MPI_COMM_WORLD, &block.request);
    }
  }
}

void Ranks::serve(const Study& study, StudyLedger& ledger, int threads, std::atomic<bool>& stop) {
  std::exception_ptr problem;
#pragma omp parallel num_threads(threads + 1)
  {
    bool main_thread = false;
#pragma omp master
    main_thread = true;
    try {
      if (main_thread) {
        const auto out = [this] {
          return std::any_of(peers_.begin(), peers_.end(),
                             [](const Peer& peer) { return !peer.blocks.empty(); });
        };
        while (true) {
          bool any = false;
          receive(ledger, stop, any);
          if (!stop) handOut(ledger, threads);
          if (!out() && (stop || ledger.waiting() == 0)) break;
          const bool in_line = std::all_of(peers_.begin() + 1, peers_.end(), [](const Peer& peer) {
            return peer.blocks.size() == kBlocks;
          });
          if (!any) std::this_thread::sleep_for(in_line ? kLongNap : kShortNap);
        }
      } else {
        StudyRunner runner(study);
        StudyTask task;
        while (!stop && ledger.take(task)) ledger.put(runner.run(task));
      }
    } catch (...) {
#pragma omp critical
      problem = std::current_exception();
      stop = true;
    }
  }
  if (problem) std::rethrow_exception(problem);
}

void Ranks::release() {
  for (int i = 1; i < size_; ++i) {
    Peer& peer = peers_[static_cast<std::size_t>(i)];
    // runs that a rank has not finished are repeated when the study goes on
    for (Block& block : peer.blocks) {
      MPI_Status status;
      MPI_Probe(i, kRecords, MPI_COMM_WORLD, &status);
      receiveFrom(status);
      MPI_Wait(&block.request, MPI_STATUS_IGNORE);
    }
    sendTo(i, kTasks, "");
  }
}

void Ranks::work(const Study& study, int threads, const std::atomic<bool>& stop) const {
  std::vector<StudyRunner> runners(static_cast<std::size_t>(threads), StudyRunner(study));
  while (true) {
    int there = 0;
    MPI_Status status;
    MPI_Iprobe(0, kTasks, MPI_COMM_WORLD, &there, &status);
    while (there == 0) {
      std::this_thread::sleep_for(kWorkerNap);
      MPI_Iprobe(0, kTasks, MPI_COMM_WORLD, &there, &status);
    }
    const std::vector<StudyTask> tasks = unpackTasks(receiveFrom(status));
    if (tasks.empty()) return;
    std::string records;
    std::atomic<std::size_t> next{0};
#pragma omp parallel for num_threads(threads) schedule(static, 1)
    for (int thread = 0; thread < threads; ++thread) {
      StudyRunner& runner = runners[static_cast<std::size_t>(thread)];
      std::string mine;
      for (std::size_t i = next++; i < tasks.size() && !stop; i = next++) {
        mine += encodeRecord(runner.run(tasks[i]));
      }
#pragma omp critical
      records += mine;
    }
    sendTo(0, kRecords, records);
  }
}

}  // namespace assembly_cell
