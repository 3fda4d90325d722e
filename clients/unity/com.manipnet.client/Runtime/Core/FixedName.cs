using System;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>A short text that can be overwritten from received bytes without allocating.</summary>
    public sealed class FixedName
    {
        static readonly UTF8Encoding Utf8 = new UTF8Encoding(false, true);
        readonly byte[] _bytes = new byte[Layout.NameBytes];
        string _text = "";

        public int Length { get; private set; }

        /// <summary>The text. Getting it allocates only if it has changed since the last time.</summary>
        public string Text
        {
            get { return _text ?? (_text = Utf8.GetString(_bytes, 0, Length)); }
        }

        /// <summary>Copies a name from a record. Returns false if it is too long or not UTF-8.</summary>
        public bool Read(byte[] data, int offset)
        {
            int length = data[offset];
            if (length > Layout.NameBytes || !IsUtf8(data, offset + 1, length)) return false;
            if (Same(data, offset + 1, length)) return true;
            Buffer.BlockCopy(data, offset + 1, _bytes, 0, length);
            Length = length;
            _text = null;
            return true;
        }

        public void Clear()
        {
            Length = 0;
            _text = "";
        }

        public void CopyFrom(FixedName other)
        {
            if (Same(other._bytes, 0, other.Length)) return;
            Buffer.BlockCopy(other._bytes, 0, _bytes, 0, other.Length);
            Length = other.Length;
            _text = other._text;
        }

        public bool SameAs(FixedName other)
        {
            return Same(other._bytes, 0, other.Length);
        }

        bool Same(byte[] data, int offset, int length)
        {
            if (length != Length) return false;
            for (int i = 0; i < length; i++)
                if (_bytes[i] != data[offset + i]) return false;
            return true;
        }

        static bool IsUtf8(byte[] data, int offset, int length)
        {
            bool ascii = true;
            for (int i = 0; i < length; i++) ascii &= data[offset + i] < 0x80;
            if (ascii) return true;
            try
            {
                Utf8.GetCharCount(data, offset, length);
                return true;
            }
            catch (ArgumentException)
            {
                return false;
            }
        }
    }
}
