using System.Globalization;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>Reads the little JSON that bone maps and refusals consist of: objects of texts.</summary>
    sealed class JsonReader
    {
        readonly string _text;

        public JsonReader(string text)
        {
            _text = text;
        }

        public int Position { get; private set; }

        public bool AtEnd
        {
            get
            {
                while (Position < _text.Length && char.IsWhiteSpace(_text[Position])) Position++;
                return Position >= _text.Length;
            }
        }

        /// <summary>Skips spaces and takes `wanted` if it comes next.</summary>
        public bool Take(char wanted)
        {
            if (AtEnd || _text[Position] != wanted) return false;
            Position++;
            return true;
        }

        /// <summary>Takes a text, or returns null if none comes next.</summary>
        public string TakeText()
        {
            if (!Take('"')) return null;
            var value = new StringBuilder();
            while (Position < _text.Length && _text[Position] != '"')
                if (!TakeCharacter(value)) return null;
            return Position++ < _text.Length && IsWhole(value.ToString()) ? value.ToString() : null;
        }

        /// <summary>Whether no character beyond 16 bits is cut in half, as by a wrong escape.</summary>
        static bool IsWhole(string text)
        {
            for (int i = 0; i < text.Length; i++)
            {
                if (!char.IsSurrogate(text[i])) continue;
                if (i + 1 >= text.Length || !char.IsSurrogatePair(text[i], text[i + 1])) return false;
                i++;
            }
            return true;
        }

        bool TakeCharacter(StringBuilder value)
        {
            char c = _text[Position++];
            if (c != '\\')
            {
                value.Append(c);
                return true;
            }
            char kind = Position < _text.Length ? _text[Position++] : '\0';
            if (kind != 'u')
            {
                int letter = "nrtbf".IndexOf(kind);
                value.Append(letter < 0 ? kind : "\n\r\t\b\f"[letter]);
                return letter >= 0 || kind == '"' || kind == '\\' || kind == '/';
            }
            int code = 0;
            if (Position + 4 > _text.Length
                || !int.TryParse(_text.Substring(Position, 4), NumberStyles.AllowHexSpecifier, CultureInfo.InvariantCulture, out code)) return false;
            value.Append((char)code);
            Position += 4;
            return true;
        }
    }
}
