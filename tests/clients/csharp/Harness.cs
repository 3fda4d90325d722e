using System;
using System.Globalization;
using System.IO;
using System.Linq;
using System.Text;
using System.Threading;
using ManipNet.Client;

/// <summary>
/// Runs the engine-free core for the tests, which talk to it in lines of text: `decode FILES`, `live ADDRESS` and
/// others.
/// </summary>
static class Harness
{
    static int Main(string[] args)
    {
        CultureInfo.DefaultThreadCurrentCulture = CultureInfo.InvariantCulture;
        Thread.CurrentThread.CurrentCulture = CultureInfo.InvariantCulture;
        Console.OutputEncoding = new UTF8Encoding(false);
        switch (args[0])
        {
            case "decode":
                for (int i = 1; i < args.Length; i++) Console.WriteLine(Decode(File.ReadAllBytes(args[i])));
                return 0;
            case "interpolate":
                Interpolate();
                return 0;
            case "axes":
                Axes();
                return 0;
            case "retarget":
                Retarget();
                return 0;
            case "names":
                Names();
                return 0;
            case "timecode":
                for (int i = 1; i < args.Length; i++) Timecode(File.ReadAllBytes(args[i]));
                return 0;
            case "bone_maps":
                BoneMaps();
                return 0;
            case "arms":
                Arms();
                return 0;
            case "partial":
                Partial();
                return 0;
            case "connect":
                Connect(args[1].Split(','), int.Parse(args[2]));
                return 0;
            case "control":
                Control(args[1]);
                return 0;
            case "find":
                Find();
                return 0;
            case "profile":
                PrintProfiles();
                return 0;
            case "avatar":
                Avatar(args[1], args[2], args[3]);
                return 0;
            case "websocket":
                WebSocket(args[1]);
                return 0;
            case "live":
                Live(args[1]);
                return 0;
            case "idle":
                Idle(args[1]);
                return 0;
        }
        return 2;
    }

    static string Decode(byte[] data)
    {
        var frame = new HandsFrame();
        string error = HandsDecoder.Decode(data, 0, data.Length, frame);
        if (error != null) return "{\"error\":" + Quote(error) + "}";
        var text = new StringBuilder();
        text.Append("{\"session\":" + Quote(frame.Session.Text) + ",\"actor\":" + Quote(frame.Actor.Text));
        text.Append(",\"seq\":" + frame.Seq + ",\"t_capture\":" + Number(frame.TCapture));
        text.Append(",\"t_publish\":" + Number(frame.TPublish) + ",\"look_ahead\":" + Number(frame.LookAhead));
        text.Append(",\"latency_ms\":" + Floats(frame.LatencyMs) + ",\"hands\":{");
        string comma = "";
        foreach (Side side in new[] { Side.Left, Side.Right })
        {
            HandFrame hand = frame.Hand(side);
            if (!hand.Present) continue;
            text.Append(comma + Quote(side.ToString().ToLowerInvariant()) + ":{\"state\":" + Quote(Layout.States[(int)hand.State]));
            text.Append(",\"object\":" + (hand.HasObject ? Quote(hand.Object.Text) : "null") + ",\"scale\":" + Number(hand.Scale));
            text.Append(",\"angles\":" + Floats(hand.Angles) + ",\"rotations\":" + Floats(hand.Rotations));
            text.Append(",\"wrist\":" + Floats(hand.Wrist) + ",\"joints\":" + Floats(hand.Joints) + "}");
            comma = ",";
        }
        text.Append("},\"bodies\":[");
        for (int i = 0; i < frame.BodyCount; i++)
        {
            BodyFrame body = frame.Body(i);
            text.Append((i > 0 ? "," : "") + "{\"name\":" + Quote(body.Name.Text) + ",\"tracked\":" + (body.Tracked ? "true" : "false"));
            text.Append(",\"pose\":" + Floats(body.Pose) + "}");
        }
        return text.Append("]}").ToString();
    }

    /// <summary>Executes the lines `delay S`, `push ARRIVAL HEX` and `show NOW` of standard input.</summary>
    static void Interpolate()
    {
        var interpolator = new Interpolator();
        HandsFrame spare = new HandsFrame(), shown = new HandsFrame();
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] word = line.Split(' ');
            double value = double.Parse(word[1], CultureInfo.InvariantCulture);
            if (word[0] == "delay") interpolator.DelayS = value;
            if (word[0] == "push")
            {
                byte[] data = FromHex(word[2]);
                string error = HandsDecoder.Decode(data, 0, data.Length, spare);
                if (error != null) throw new InvalidDataException(error);
                bool taken;
                spare = interpolator.Push(spare, value, out taken);
                Console.WriteLine(taken ? "1" : "0");
            }
            if (word[0] == "show")
            {
                float weight;
                bool any = interpolator.Sample(value, shown, out weight);
                HandFrame hand = shown.Left;
                Console.WriteLine(!any ? "none" : string.Join(" ", new[]
                {
                    Number(weight), shown.Seq.ToString(), Number(hand.Wrist[0]), Number(hand.Wrist[5]), Number(hand.Wrist[6]),
                    Number(hand.Angles[3]), Number(hand.Joints[7 * 25]), Number(shown.Body(0).Pose[0]),
                }));
            }
        }
    }

    static void Axes()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            float[] pose = Array.ConvertAll(line.Split(' '), word => float.Parse(word, CultureInfo.InvariantCulture));
            Vec3 p = UnityAxes.Position(pose, 0);
            Quat q = UnityAxes.Rotation(pose, 3);
            Console.WriteLine(string.Join(" ", new[] { p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W }.Select(x => Number(x))));
        }
    }

    /// <summary>
    /// Reads a line with side, 15 poses and 5 tips and a line with a message in hex; prints 15 rotations and the
    /// hand's.
    /// </summary>
    static void Retarget()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            float[] x = Array.ConvertAll(line.Split(' '), word => float.Parse(word, CultureInfo.InvariantCulture));
            var positions = new Vec3[HandRig.BoneCount];
            var rotations = new Quat[HandRig.BoneCount];
            for (int i = 0; i < HandRig.BoneCount; i++)
            {
                positions[i] = new Vec3(x[7 * i + 1], x[7 * i + 2], x[7 * i + 3]);
                rotations[i] = new Quat(x[7 * i + 4], x[7 * i + 5], x[7 * i + 6], x[7 * i + 7]);
            }
            Vec3[] tips = Enumerable.Range(0, 5).Select(i => new Vec3(x[106 + 3 * i], x[107 + 3 * i], x[108 + 3 * i])).ToArray();
            var rig = new HandRig((Side)x[0], positions, rotations, tips);
            byte[] data = FromHex(Console.ReadLine());
            var frame = new HandsFrame();
            HandsDecoder.Decode(data, 0, data.Length, frame);
            rig.Solve(frame.Hand((Side)x[0]), rotations);
            foreach (Quat q in rotations.Concat(new[] { rig.HandRotation(frame.Hand((Side)x[0])) }))
                Console.Write(string.Join(" ", new[] { q.X, q.Y, q.Z, q.W }.Select(v => Number(v))) + " ");
            Console.WriteLine();
        }
    }

    /// <summary>Prints which bone each name means, as side, finger and part.</summary>
    static void Names()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string found = "none";
            foreach (Side side in new[] { Side.Left, Side.Right })
            {
                if (RigNames.IsHand(line, side)) found = side + " hand";
                for (int finger = 0; finger < 5; finger++)
                    for (int part = 0; part < 3; part++)
                        if (RigNames.Matches(line, side, finger, part)) found = side + " " + finger + " " + part;
            }
            Console.WriteLine(found);
        }
    }

    static void Timecode(byte[] data)
    {
        var frame = new HandsFrame();
        HandsDecoder.Decode(data, 0, data.Length, frame);
        Console.WriteLine(frame.Timecode.Text + " " + frame.TimecodeRate.ToString(CultureInfo.InvariantCulture));
    }

    /// <summary>Prints the meaning of each line as a bone map, sorted by the names of its keys.</summary>
    static void BoneMaps()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            try
            {
                BoneMap map = BoneMap.Parse(line);
                string[] entries = map.Bones.Select(bone => map.NameOf(bone) + "=" + bone + ";").ToArray();
                Array.Sort(entries, StringComparer.Ordinal);
                Console.WriteLine(string.Join("", entries));
            }
            catch (ArgumentException error)
            {
                Console.WriteLine("error: " + error.Message);
            }
        }
    }

    /// <summary>Reads shoulder, elbow, wrist and target; prints where elbow and wrist arrive.</summary>
    static void Arms()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            float[] x = line.Split(' ').Select(word => float.Parse(word, CultureInfo.InvariantCulture)).ToArray();
            var at = new Vec3[4];
            for (int i = 0; i < 4; i++) at[i] = new Vec3(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
            Quat upper, lower;
            ArmIk.Solve(at[0], at[1], at[2], at[3], out upper, out lower);
            Vec3 elbow = at[0] + upper.Rotate(at[1] - at[0]), wrist = elbow + lower.Rotate(at[2] - at[1]);
            Console.WriteLine(string.Join(" ", new[] { elbow.X, elbow.Y, elbow.Z, wrist.X, wrist.Y, wrist.Z }.Select(v => Number(v)).ToArray()));
        }
    }

    /// <summary>As Retarget, for a rig that has only the bones whose indices are in the line after it.</summary>
    static void Partial()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            float[] x = line.Split(' ').Select(word => float.Parse(word, CultureInfo.InvariantCulture)).ToArray();
            var positions = new Vec3[15];
            var rotations = new Quat[15];
            var tips = new Vec3[5];
            for (int i = 0; i < 15; i++)
            {
                int at = 1 + 7 * i;
                positions[i] = new Vec3(x[at], x[at + 1], x[at + 2]);
                rotations[i] = new Quat(x[at + 3], x[at + 4], x[at + 5], x[at + 6]);
            }
            for (int i = 0; i < 5; i++) tips[i] = new Vec3(x[106 + 3 * i], x[107 + 3 * i], x[108 + 3 * i]);
            var present = new bool[15];
            foreach (string word in Console.ReadLine().Split(' ')) present[int.Parse(word)] = true;
            var rig = new HandRig((Side)x[0], positions, rotations, tips, true, present);
            byte[] data = FromHex(Console.ReadLine());
            var frame = new HandsFrame();
            HandsDecoder.Decode(data, 0, data.Length, frame);
            var output = new Quat[15];
            rig.Solve(frame.Hand((Side)x[0]), output);
            Console.WriteLine(string.Join(" ", output.SelectMany(q => new[] { q.X, q.Y, q.Z, q.W }).Select(v => Number(v)).ToArray()));
        }
    }

    /// <summary>Connects to the first of several addresses that answers, and prints which one that is.</summary>
    static void Connect(string[] addresses, int port)
    {
        try
        {
            var found = addresses.Select(System.Net.IPAddress.Parse).ToArray();
            using (var socket = new ZmtpSubscriber(1024).ConnectToAny(found, "a name", port)) Console.WriteLine(socket.RemoteEndPoint);
        }
        catch (IOException error)
        {
            Console.WriteLine("error: " + error.Message);
        }
    }

    /// <summary>Sends a request for each line, with its op, names and values separated by tabs, and prints the reply.</summary>
    static void Control(string address)
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] words = line.Split('\t');
            object[] fields = words.Skip(1).Select(Value).ToArray();
            try
            {
                Console.WriteLine(new ControlClient(address, 5.0).Ask(words[0], fields));
            }
            catch (Exception error) when (error is RequestException || error is IOException || error is System.Net.Sockets.SocketException)
            {
                Console.WriteLine(error.GetType().Name + " " + error.Message);
            }
        }
    }

    static object Value(string word)
    {
        double number;
        if (word == "true" || word == "false") return word == "true";
        return double.TryParse(word, NumberStyles.Float, CultureInfo.InvariantCulture, out number) ? (object)number : word;
    }

    /// <summary>
    /// Reads lines with a side and the names of bones, separated by tabs; prints the indices of the hand, 15 finger bones and 4
    /// metacarpals.
    /// </summary>
    static void Find()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] words = line.Split('\t');
            BoneIndices found = BoneFinder.Find(words.Skip(1).ToArray(), words[0] == "left" ? Side.Left : Side.Right);
            Console.WriteLine(string.Join(" ", new[] { found.Hand }.Concat(found.Fingers).Concat(found.Metacarpals.Skip(1)).Select(i => i.ToString()).ToArray()));
        }
    }

    /// <summary>Reads a hand at rest: side, 15 times presence and pose, 5 times presence and tip, the same for metacarpals.</summary>
    static RestHand ReadRest(string line, out Side side)
    {
        float[] x = line.Split(' ').Select(word => float.Parse(word, CultureInfo.InvariantCulture)).ToArray();
        side = (Side)x[0];
        var rest = new RestHand();
        for (int i = 0; i < 15; i++)
        {
            int at = 1 + 8 * i;
            rest.Present[i] = x[at] != 0f;
            rest.Positions[i] = new Vec3(x[at + 1], x[at + 2], x[at + 3]);
            rest.Rotations[i] = new Quat(x[at + 4], x[at + 5], x[at + 6], x[at + 7]);
        }
        for (int i = 0; i < 5; i++)
        {
            int tip = 121 + 4 * i, metacarpal = 141 + 4 * i;
            rest.HasTip[i] = x[tip] != 0f;
            rest.Tips[i] = new Vec3(x[tip + 1], x[tip + 2], x[tip + 3]);
            rest.HasMetacarpal[i] = x[metacarpal] != 0f;
            rest.Metacarpals[i] = new Vec3(x[metacarpal + 1], x[metacarpal + 2], x[metacarpal + 3]);
        }
        return rest;
    }

    /// <summary>Prints the profile of each hand that is read, or why it has none.</summary>
    static void PrintProfiles()
    {
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            try
            {
                Side side;
                RestHand rest = ReadRest(line, out side);
                var profile = new HandProfile(side, rest);
                Console.WriteLine(HandProfile.Json("avatar", side == Side.Left ? profile : null, side == Side.Right ? profile : null));
            }
            catch (ArgumentException error)
            {
                Console.WriteLine("error: " + error.Message);
            }
        }
    }

    /// <summary>
    /// Uploads the profile of the two hands in the first lines and receives them. For each further line it prints the state, the
    /// frames received, and for each hand the joints of the message and the hand bone and finger bones of the avatar.
    /// </summary>
    static void Avatar(string address, string control, string name)
    {
        Side side;
        AvatarRig[] rigs = { new AvatarRig(Side.Left, ReadRest(Console.ReadLine(), out side)), new AvatarRig(Side.Right, ReadRest(Console.ReadLine(), out side)) };
        string profile = HandProfile.Json(name, rigs[0].Profile, rigs[1].Profile);
        var shown = new HandsFrame();
        var bones = new Quat[15];
        using (var client = new AvatarClient(address, control, name, profile, null, 0.05))
        {
            while (Console.ReadLine() != null)
            {
                float weight;
                bool any = client.Sample(LocalClock.Now, shown, out weight);
                Stats stats = client.GetStats();
                var text = new StringBuilder("{\"state\": " + ControlClient.Quoted(stats.State) + ", \"received\": " + stats.Received + ", \"weight\": " + Number(weight));
                foreach (Side which in new[] { Side.Left, Side.Right })
                {
                    HandFrame hand = shown.Hand(which);
                    if (!any || !hand.Present) continue;
                    AvatarRig rig = rigs[(int)which];
                    rig.Solve(hand, bones);
                    Vec3 p = rig.HandPosition(hand);
                    Quat q = rig.HandRotation(hand);
                    text.Append(", \"" + which.ToString().ToLowerInvariant() + "\": {\"joints\": " + Floats(hand.Joints));
                    text.Append(", \"hand\": " + Floats(new[] { p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W }));
                    text.Append(", \"bones\": " + Floats(bones.SelectMany(b => new[] { b.X, b.Y, b.Z, b.W }).ToArray()) + "}");
                }
                Console.WriteLine(text.Append("}"));
            }
        }
        Console.WriteLine("closed");
    }

    /// <summary>A web socket that a script drives.</summary>
    sealed class ScriptedSocket : IWebSocket
    {
        public readonly System.Collections.Generic.Queue<byte[]> Waiting = new System.Collections.Generic.Queue<byte[]>();
        public int Opened;
        public void Open(string address) { Opened++; State = WebSocketState.Connecting; }
        public WebSocketState State { get; set; }
        public int NextLength { get { return Waiting.Count == 0 ? 0 : Waiting.Peek().Length; } }
        public void Take(byte[] into) { Waiting.Dequeue().CopyTo(into, 0); }
        public void Skip() { Waiting.Dequeue(); }
        public void Close() { State = WebSocketState.Closed; }
    }

    /// <summary>
    /// Runs lines of a script: `open`, `close`, `message HEX`, `huge`, and `show T`, which prints what a client knows.
    /// </summary>
    static void WebSocket(string address)
    {
        var socket = new ScriptedSocket();
        WebSocketClient client;
        try
        {
            client = new WebSocketClient(socket, address);
        }
        catch (ArgumentException error)
        {
            Console.WriteLine("error: " + error.Message);
            return;
        }
        double start = LocalClock.Now;
        var frame = new HandsFrame();
        string line;
        while ((line = Console.ReadLine()) != null)
        {
            string[] words = line.Split(' ');
            if (words[0] == "open") socket.State = WebSocketState.Open;
            if (words[0] == "close") socket.State = WebSocketState.Closed;
            if (words[0] == "message") socket.Waiting.Enqueue(FromHex(words[1]));
            if (words[0] == "huge") socket.Waiting.Enqueue(new byte[Layout.MaxPayloadBytes + 1]);
            if (words[0] != "show") continue;
            float weight;
            bool shown = client.Sample(start + double.Parse(words[1], CultureInfo.InvariantCulture), frame, out weight);
            Stats stats = client.GetStats();
            Console.WriteLine(stats.State + "|" + stats.Received + "|" + stats.Refused + "|" + stats.Connections + "|" + socket.Opened + "|" + shown);
        }
        client.Dispose();
    }

    static byte[] FromHex(string hex)
    {
        var data = new byte[hex.Length / 2];
        for (int i = 0; i < data.Length; i++) data[i] = Convert.ToByte(hex.Substring(2 * i, 2), 16);
        return data;
    }

    /// <summary>
    /// Shows at about 90 Hz until standard input ends. Answers "arrivals" with number and time of every frame since the
    /// last time, and any other line with figures.
    /// </summary>
    static void Live(string address)
    {
        using (var client = new ManipNetClient(address, null, 0.05))
        {
            var display = new Display { Client = client };
            var reader = new Thread(() =>
            {
                string line;
                while ((line = Console.ReadLine()) != null) Volatile.Write(ref display.Question, line);
                Volatile.Write(ref display.Ended, true);
            }) { IsBackground = true };
            reader.Start();
            while (!Volatile.Read(ref display.Ended))
            {
                display.Step();
                Thread.Sleep(1);
                string question = Interlocked.Exchange(ref display.Question, null);
                if (question == null) continue;
                Console.WriteLine(question == "arrivals" ? display.Arrivals() : display.Figures());
                Console.Out.Flush();
                GC.Collect(); // the allocations of answers do not count
                display.Collections = GC.CollectionCount(0);
            }
        }
        Console.WriteLine("closed");
    }

    /// <summary>Blocks the main thread and shows nothing; prints figures for every line of standard input.</summary>
    static void Idle(string address)
    {
        using (var client = new ManipNetClient(address, null, 0.05))
        {
            var display = new Display { Client = client };
            while (Console.ReadLine() != null) Console.WriteLine(display.Figures());
        }
        Console.WriteLine("closed");
    }

    /// <summary>
    /// Shows hands as a program would, and records what it received and showed. Only answers allocate.
    /// </summary>
    sealed class Display
    {
        public ManipNetClient Client;
        public string Question;
        public bool Ended;
        public int Collections;
        readonly HandsFrame _shown = new HandsFrame();
        readonly double[] _seqs = new double[1 << 16], _times = new double[1 << 16];
        int _recorded, _shows;
        ulong _seq;
        double _due;
        float _weight;

        public void Step()
        {
            Stats stats = Client.GetStats();
            double now = LocalClock.Now;
            if (stats.Received > 0 && stats.Seq != _seq && _recorded < _seqs.Length)
            {
                _seq = stats.Seq;
                _seqs[_recorded] = _seq;
                _times[_recorded++] = now - stats.AgeS;
            }
            if (now < _due) return;
            _due = now + 1.0 / 90.0;
            if (Client.Sample(now, _shown, out _weight)) _shows++;
        }

        public string Arrivals()
        {
            string text = string.Join(",", Enumerable.Range(0, _recorded).Select(i => "[" + _seqs[i] + "," + Number(_times[i]) + "]"));
            _recorded = 0;
            return "[" + text + "]";
        }

        public string Figures()
        {
            Stats stats = Client.GetStats();
            return "{\"state\":" + Quote(stats.State) + ",\"received\":" + stats.Received + ",\"lost\":" + stats.Lost
                + ",\"late\":" + stats.Late + ",\"refused\":" + stats.Refused + ",\"connections\":" + stats.Connections
                + ",\"seq\":" + stats.Seq + ",\"rate_hz\":" + Number(stats.RateHz)
                + ",\"age_s\":" + (double.IsInfinity(stats.AgeS) ? "null" : Number(stats.AgeS))
                + ",\"transit_s\":" + Number(stats.TransitS) + ",\"weight\":" + Number(_weight) + ",\"shown_seq\":" + _shown.Seq
                + ",\"session\":" + Quote(_shown.Session.Text) + ",\"shows\":" + _shows
                + ",\"collections\":" + (GC.CollectionCount(0) - Collections) + "}";
        }
    }

    static string Floats(float[] values)
    {
        var parts = new string[values.Length];
        for (int i = 0; i < values.Length; i++) parts[i] = values[i].ToString("G9", CultureInfo.InvariantCulture);
        return "[" + string.Join(",", parts) + "]";
    }

    static string Number(double value)
    {
        return value.ToString("G17", CultureInfo.InvariantCulture);
    }

    static string Quote(string text)
    {
        return "\"" + text.Replace("\\", "\\\\").Replace("\"", "\\\"") + "\"";
    }
}
