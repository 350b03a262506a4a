// Unity: sends the joints of a humanoid avatar to kinespace and prints what it answers. Put it on an object, drag the
// avatar's Animator into it, and start elsewhere: kinespace live
using System;
using System.Collections.Generic;
using System.Net;
using System.Net.Sockets;
using System.Text;
using UnityEngine;

public class Kinespace : MonoBehaviour
{
    public Animator avatar;
    public string performer = "unity";
    public string host = "127.0.0.1";
    public int listens = 9310;  // where kinespace listens
    public int answers = 9311;  // where it answers to
    public string label = "";   // a class, or still, or unknown

    readonly List<HumanBodyBones> bones = new List<HumanBodyBones>();
    UdpClient sender, receiver;
    float nextNames;

    void Start()
    {
        sender = new UdpClient(host, listens);
        receiver = new UdpClient(new IPEndPoint(IPAddress.Loopback, answers));
        // The body: bones up to RightToes, and UpperChest. Fingers and eyes would only tremble.
        foreach (HumanBodyBones bone in Enum.GetValues(typeof(HumanBodyBones)))
            if ((bone <= HumanBodyBones.RightToes || bone == HumanBodyBones.UpperChest)
                && avatar.GetBoneTransform(bone) != null) bones.Add(bone);
    }

    void LateUpdate()
    {
        if (Time.time >= nextNames)
        {
            nextNames = Time.time + 1;
            var names = new List<object> { performer };
            foreach (var bone in bones) names.Add(bone.ToString());
            Send("/motion/skeleton", names);
        }
        var frame = new List<object> { performer, Time.time };
        foreach (var bone in bones)
        {
            Vector3 place = avatar.GetBoneTransform(bone).position;
            frame.Add(place.x); frame.Add(place.y); frame.Add(-place.z);
        }
        Send("/motion/frame", frame);
        while (receiver.Available > 0)
        {
            IPEndPoint from = null;
            Hear(receiver.Receive(ref from), 0);
        }
    }

    void OnDestroy() { sender?.Dispose(); receiver?.Dispose(); }

    // --- OSC: texts end in zeros up to a multiple of four, numbers have their largest byte first -----------------------

    void Send(string address, List<object> arguments)
    {
        var packet = new List<byte>();
        string types = ",";
        foreach (object argument in arguments) types += argument is string ? "s" : "f";
        Add(packet, address); Add(packet, types);
        foreach (object argument in arguments)
            if (argument is string text) Add(packet, text);
            else
            {
                byte[] number = BitConverter.GetBytes((float)argument);
                Array.Reverse(number);
                packet.AddRange(number);
            }
        sender.Send(packet.ToArray(), packet.Count);
    }

    static void Add(List<byte> packet, string text)
    {
        packet.AddRange(Encoding.UTF8.GetBytes(text));
        do packet.Add(0); while (packet.Count % 4 != 0);
    }

    void Hear(byte[] packet, int start)
    {
        int place = start;
        string address = Text(packet, ref place);
        if (address == "#bundle")
        {
            for (place += 8; place < packet.Length;)
            {
                int size = IPAddress.NetworkToHostOrder(BitConverter.ToInt32(packet, place));
                Hear(packet, place + 4);
                place += 4 + size;
            }
            return;
        }
        if (address != $"/motion/{performer}/label") return;
        Text(packet, ref place);
        string answered = Text(packet, ref place);
        if (answered != label) Debug.Log($"{performer}: {answered}");
        label = answered;
    }

    static string Text(byte[] packet, ref int place)
    {
        int end = Array.IndexOf(packet, (byte)0, place);
        string text = Encoding.UTF8.GetString(packet, place, end - place);
        place = (end / 4 + 1) * 4;
        return text;
    }
}
