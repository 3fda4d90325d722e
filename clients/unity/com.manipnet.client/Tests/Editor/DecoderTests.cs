using NUnit.Framework;

namespace ManipNet.Client.Tests
{
    public sealed class DecoderTests
    {
        [Test]
        public void RefusesOtherData()
        {
            string error = HandsDecoder.Decode(new byte[300], 0, 300, new HandsFrame());
            StringAssert.Contains("MNPL", error);
        }

        [Test]
        public void NamesBothVersionsWhenItRefusesOne()
        {
            var message = new byte[Layout.HeaderBytes];
            System.BitConverter.GetBytes(Layout.Magic).CopyTo(message, 0);
            message[Layout.HeaderVersion] = 9;
            string error = HandsDecoder.Decode(message, 0, message.Length, new HandsFrame());
            StringAssert.Contains("version 9", error);
            StringAssert.Contains("version " + Layout.Version, error);
        }
    }
}
