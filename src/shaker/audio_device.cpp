// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "audio_device.h"

#include <alsa/asoundlib.h>

#include <algorithm>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

struct AudioDevice::Handle {
  ~Handle() {
    if (pcm != nullptr) snd_pcm_close(pcm);
  }
  snd_pcm_t* pcm = nullptr;
};

namespace {

// The reason of an error is in the exception.
void ignoreMessage(const char*, int, const char*, int, const char*, ...) {}

[[noreturn]] void refuse(const AudioDevice::Settings& s, const char* what, long code) {
  throw InputError(text(
      "device is '%s': %s: %s: give a name of `aplay -L`, free and with %u "
      "channels at %u Hz",
      printable(s.device).c_str(), what, snd_strerror(static_cast<int>(code)), s.channels, s.rate));
}

}  // namespace

AudioDevice::AudioDevice(const Settings& settings)
    : handle_(std::make_unique<Handle>()), settings_(settings) {
  snd_lib_error_set_handler(ignoreMessage);
  const auto check = [this](int code, const char* what) {
    if (code < 0) refuse(settings_, what, code);
  };
  check(snd_pcm_open(&handle_->pcm, settings_.device.c_str(), SND_PCM_STREAM_PLAYBACK,
                     SND_PCM_NONBLOCK),
        "can't be opened");
  const auto microseconds = static_cast<unsigned>(1e6 * settings_.buffer);
  check(snd_pcm_set_params(handle_->pcm, SND_PCM_FORMAT_S16_LE, SND_PCM_ACCESS_RW_INTERLEAVED,
                           settings_.channels, settings_.rate, 1, microseconds),
        "refuses");
  const snd_pcm_type_t type = snd_pcm_type(handle_->pcm);
  has_rate_ = type != SND_PCM_TYPE_NULL && type != SND_PCM_TYPE_FILE;
}

AudioDevice::~AudioDevice() = default;

void AudioDevice::recover(long code, const char* what) {
  if (code == -EAGAIN) return;
  ++gaps_;
  const int done = snd_pcm_recover(handle_->pcm, static_cast<int>(code), 1);
  if (done < 0) refuse(settings_, what, done);
}

double AudioDevice::queued() {
  snd_pcm_sframes_t frames = 0;
  const int code = snd_pcm_delay(handle_->pcm, &frames);
  if (code < 0) {
    recover(code, "is lost");
    return 0.0;
  }
  return static_cast<double>(std::max<snd_pcm_sframes_t>(frames, 0));
}

std::size_t AudioDevice::available() {
  const snd_pcm_sframes_t frames = snd_pcm_avail_update(handle_->pcm);
  if (frames < 0) recover(frames, "is lost");
  return static_cast<std::size_t>(std::max<snd_pcm_sframes_t>(frames, 0));
}

void AudioDevice::write(const std::vector<std::int16_t>& frames) {
  std::size_t done = 0;
  const std::size_t all = frames.size() / settings_.channels;
  // a second attempt after a gap
  for (int attempt = 0; attempt < 2 && done < all; ++attempt) {
    const snd_pcm_sframes_t taken =
        snd_pcm_writei(handle_->pcm, frames.data() + done * settings_.channels, all - done);
    if (taken < 0) {
      recover(taken, "can't be written to");
    } else {
      done += static_cast<std::size_t>(taken);
    }
  }
  // ALSA starts a short queue late
  if (snd_pcm_state(handle_->pcm) == SND_PCM_STATE_PREPARED) snd_pcm_start(handle_->pcm);
}

}  // namespace assembly_cell
