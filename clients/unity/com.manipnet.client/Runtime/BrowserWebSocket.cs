#if UNITY_WEBGL && !UNITY_EDITOR
using System.Runtime.InteropServices;

namespace ManipNet.Client.Unity
{
    /// <summary>The web socket of the browser that runs a WebGL build, through Plugins/WebGL/ManipNet.jslib.</summary>
    public sealed class BrowserWebSocket : IWebSocket
    {
        [DllImport("__Internal")]
        static extern int ManipNetOpen(string address);

        [DllImport("__Internal")]
        static extern int ManipNetState(int socket);

        [DllImport("__Internal")]
        static extern int ManipNetNextLength(int socket);

        [DllImport("__Internal")]
        static extern void ManipNetTake(int socket, byte[] into, int capacity);

        [DllImport("__Internal")]
        static extern void ManipNetClose(int socket);

        int _socket;

        public void Open(string address)
        {
            _socket = ManipNetOpen(address);
        }

        public WebSocketState State
        {
            get { return (WebSocketState)ManipNetState(_socket); }
        }

        public int NextLength
        {
            get { return ManipNetNextLength(_socket); }
        }

        public void Take(byte[] into)
        {
            ManipNetTake(_socket, into, into.Length);
        }

        public void Skip()
        {
            ManipNetTake(_socket, new byte[1], 0);
        }

        public void Close()
        {
            ManipNetClose(_socket);
        }
    }
}
#endif
