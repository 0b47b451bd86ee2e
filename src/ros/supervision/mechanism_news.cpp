// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/mechanism_news.h"

#include <std_msgs/String.h>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

ros::Subscriber subscribeMechanism(ros::NodeHandle& nh,
                                   const std::function<void(const KnownMechanism&)>& heard) {
  using Event = ros::MessageEvent<std_msgs::String const>;
  constexpr std::size_t kLongest = 1000000;  // of its text [bytes]; a hundred times what one has
  const std::string name = nh.resolveName(kMechanismTopic);
  const boost::function<void(const Event&)> receive = [name, heard](const Event& event) {
    const std::string& text = event.getConstMessage()->data;
    std::string why;
    if (text.size() > kLongest) {
      why = "a text of " + std::to_string(text.size()) + " bytes";
    } else {
      try {
        const KnownMechanism known = parseKnownMechanism(text, name);
        if (known.accepted) {
          guarded(name, [&] { heard(known); });
          return;
        }
        why = "its identification says " + known.verdict;
      } catch (const InputError& error) {
        why = error.what();
      }
    }
    IncomingLog::ofThisProcess().refuse(name, event.getPublisherName(), why);
  };
  return nh.subscribe<std_msgs::String, const Event&>(kMechanismTopic, 1, receive);
}

}  // namespace assembly_cell::ros_bridge
