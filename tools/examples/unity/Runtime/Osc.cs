// OSC 1.0, as much of it as kinespace speaks: messages to bytes, and packets to messages.
// Texts end in zeros up to a multiple of four bytes; of a number the largest byte comes first.
using System;
using System.Collections.Generic;
using System.Text;
using System.Text.RegularExpressions;

namespace Kinespace
{
    public sealed class OscMessage
    {
        public string Address, Types;  // types as OSC writes them, like ",sif"
        public readonly List<object> Arguments = new List<object>();
    }

    public static class Osc
    {
        // Bundles in bundles that are read; kinespace sends one level.
        const int MaxDepth = 4;

        // Letters of any script stay; what OSC reserves, and what does not print, is written as in a URL: a%20b.
        static readonly Regex NotInAddress =
            new Regex(@"[ #*,/?\[\]{}%]|[\p{Zs}\p{Zl}\p{Zp}\p{Cc}\p{Cf}\p{Co}\p{Cn}]", RegexOptions.CultureInvariant);

        public static string AddressPart(string name) { return NotInAddress.Replace(name, each => Written(each.Value)); }

        static string Written(string text)
        {
            var written = new StringBuilder();
            foreach (byte each in Encoding.UTF8.GetBytes(text)) written.Append('%').Append(each.ToString("X2"));
            return written.ToString();
        }

        /// <summary>Encodes a message; arguments are texts, whole numbers, floats and doubles.</summary>
        public static byte[] Encode(string address, IEnumerable<object> arguments)
        {
            var types = new StringBuilder(",");
            var values = new List<byte>();
            foreach (object argument in arguments)
            {
                if (argument is string text) { types.Append('s'); Add(values, text); }
                else if (argument is int whole) { types.Append('i'); Add(values, BitConverter.GetBytes(whole)); }
                else if (argument is float single) { types.Append('f'); Add(values, BitConverter.GetBytes(single)); }
                else if (argument is double number) { types.Append('d'); Add(values, BitConverter.GetBytes(number)); }
                else throw new ArgumentException("arguments: expected texts and numbers, got " + argument);
            }
            var packet = new List<byte>();
            Add(packet, address);
            Add(packet, types.ToString());
            packet.AddRange(values);
            return packet.ToArray();
        }

        /// <summary>Reads the messages of a packet, up to the first that cannot be read.</summary>
        public static List<OscMessage> Read(byte[] packet)
        {
            var messages = new List<OscMessage>();
            try { Read(packet, 0, packet.Length, messages, 0); }
            catch (ArgumentException) { }  // cut off, or no OSC
            return messages;
        }

        static void Read(byte[] packet, int place, int end, List<OscMessage> messages, int depth)
        {
            string address = Text(packet, ref place, end);
            if (address == "#bundle" && depth < MaxDepth)
            {
                for (place += 8; place < end;)
                {
                    int size = BitConverter.ToInt32(Number(packet, ref place, end, 4), 0);
                    if (size < 0 || size > end - place) throw new ArgumentException("size");
                    Read(packet, place, place + size, messages, depth + 1);
                    place += size;
                }
                return;
            }
            string types = Text(packet, ref place, end);
            var message = new OscMessage { Address = address, Types = types };
            for (int i = 1; i < types.Length; i++)
                switch (types[i])
                {
                    case 's': message.Arguments.Add(Text(packet, ref place, end)); break;
                    case 'i': message.Arguments.Add(BitConverter.ToInt32(Number(packet, ref place, end, 4), 0)); break;
                    case 'f': message.Arguments.Add(BitConverter.ToSingle(Number(packet, ref place, end, 4), 0)); break;
                    case 'd': message.Arguments.Add(BitConverter.ToDouble(Number(packet, ref place, end, 8), 0)); break;
                    default: throw new ArgumentException("type");
                }
            messages.Add(message);
        }

        static string Text(byte[] packet, ref int place, int end)
        {
            int stop = place < end ? Array.IndexOf(packet, (byte)0, place, end - place) : -1;
            if (stop < 0) throw new ArgumentException("text");
            string text = Encoding.UTF8.GetString(packet, place, stop - place);
            place += ((stop - place) / 4 + 1) * 4;
            return text;
        }

        static byte[] Number(byte[] packet, ref int place, int end, int size)
        {
            if (size > end - place) throw new ArgumentException("number");
            var bytes = new byte[size];
            Array.Copy(packet, place, bytes, 0, size);
            place += size;
            if (BitConverter.IsLittleEndian) Array.Reverse(bytes);
            return bytes;
        }

        static void Add(List<byte> packet, byte[] number)
        {
            if (BitConverter.IsLittleEndian) Array.Reverse(number);
            packet.AddRange(number);
        }

        static void Add(List<byte> packet, string text)
        {
            packet.AddRange(Encoding.UTF8.GetBytes(text));
            do packet.Add(0); while (packet.Count % 4 != 0);
        }
    }
}
