// Sends the joints of a humanoid avatar to kinespace, and says which motion starts, ends and was done.
// Put it on an object, drag the avatar's Animator into it, and start elsewhere: kinespace live
using System;
using System.Collections.Generic;
using System.Net;
using System.Net.Sockets;
using UnityEngine;
using UnityEngine.Events;

namespace Kinespace
{
    [Serializable] public class MotionEvent : UnityEvent<string> { }

    public class KinespacePerformer : MonoBehaviour
    {
        public Animator avatar;
        public string performer = "unity";
        public string host = "127.0.0.1";
        public int listens = 9310;  // where kinespace listens
        public int answers = 9311;  // where it answers to
        public MotionEvent started = new MotionEvent(), ended = new MotionEvent(), done = new MotionEvent();

        public string Label { get; private set; } = "";  // a class, or still, unknown, ambiguous, gone
        // With kinespace live --progress, of the motion that goes on.
        public float Phase { get; private set; }
        public float Speed { get; private set; }
        public float Amplitude { get; private set; }

        readonly List<HumanBodyBones> bones = new List<HumanBodyBones>();
        UdpClient sender, receiver;
        string own;
        float nextNames;

        void Start()
        {
            own = "/motion/" + Osc.AddressPart(performer) + "/";
            sender = new UdpClient(host, listens);
            bool near = host == "127.0.0.1" || host == "localhost";
            receiver = new UdpClient(new IPEndPoint(near ? IPAddress.Loopback : IPAddress.Any, answers));
            // The body: bones up to RightToes, and UpperChest. Fingers and eyes would only tremble.
            foreach (HumanBodyBones bone in Enum.GetValues(typeof(HumanBodyBones)))
                if ((bone <= HumanBodyBones.RightToes || bone == HumanBodyBones.UpperChest)
                    && avatar.GetBoneTransform(bone) != null) bones.Add(bone);
        }

        // After the Animator has moved the bones.
        void LateUpdate()
        {
            if (Time.time >= nextNames)
            {
                nextNames = Time.time + 1;
                var names = new List<object> { performer };
                foreach (var bone in bones) names.Add(bone.ToString());
                Send("/motion/skeleton", names);
            }
            var frame = new List<object> { performer, Time.timeAsDouble };
            foreach (var bone in bones)
            {
                Vector3 place = avatar.GetBoneTransform(bone).position;
                // Unity's z points the other way.
                frame.Add(place.x); frame.Add(place.y); frame.Add(-place.z);
            }
            Send("/motion/frame", frame);
            // Not Available: it is 0 also where an empty packet waits.
            while (receiver.Client.Poll(0, SelectMode.SelectRead))
            {
                IPEndPoint from = null;
                foreach (var message in Osc.Read(receiver.Receive(ref from))) Hear(message);
            }
        }

        void OnDestroy() { sender?.Dispose(); receiver?.Dispose(); }

        void Send(string address, List<object> arguments)
        {
            byte[] packet = Osc.Encode(address, arguments);
            try { sender.Send(packet, packet.Length); }
            catch (SocketException) { }  // kinespace does not run yet
        }

        void Hear(OscMessage message)
        {
            if (!message.Address.StartsWith(own, StringComparison.Ordinal)) return;
            var got = message.Arguments;
            switch (message.Address.Substring(own.Length) + message.Types)
            {
                case "label,s": Label = (string)got[0]; break;
                case "event,ssiff": ((string)got[0] == "start" ? started : ended).Invoke((string)got[1]); break;
                case "done,siifffff": done.Invoke((string)got[0]); break;
                case "progress,ifffffi":
                    Phase = (float)got[1]; Speed = (float)got[2]; Amplitude = (float)got[3]; break;
            }
        }
    }
}
