// AXI4 with 64 bits of data in, AXI4-Lite with 32 bits out: one access at a time, of up to 4 bytes, as processors make to
// device memory. A burst, or a beat of 8 bytes, is answered with SLVERR and does not reach the registers.
module axi4_to_lite #(
    parameter int ID = 4
) (
    input logic clock,
    input logic reset,

    input  logic [ID-1:0] s_axi_awid,
    input  logic [  31:0] s_axi_awaddr,
    input  logic [   7:0] s_axi_awlen,
    input  logic [   2:0] s_axi_awsize,
    input  logic          s_axi_awvalid,
    output logic          s_axi_awready,
    input  logic [  63:0] s_axi_wdata,
    input  logic [   7:0] s_axi_wstrb,
    input  logic          s_axi_wlast,
    input  logic          s_axi_wvalid,
    output logic          s_axi_wready,
    output logic [ID-1:0] s_axi_bid,
    output logic [   1:0] s_axi_bresp,
    output logic          s_axi_bvalid,
    input  logic          s_axi_bready,
    input  logic [ID-1:0] s_axi_arid,
    input  logic [  31:0] s_axi_araddr,
    input  logic [   7:0] s_axi_arlen,
    input  logic [   2:0] s_axi_arsize,
    input  logic          s_axi_arvalid,
    output logic          s_axi_arready,
    output logic [ID-1:0] s_axi_rid,
    output logic [  63:0] s_axi_rdata,
    output logic [   1:0] s_axi_rresp,
    output logic          s_axi_rlast,
    output logic          s_axi_rvalid,
    input  logic          s_axi_rready,

    output logic [15:0] m_axil_awaddr,
    output logic        m_axil_awvalid,
    input  logic        m_axil_awready,
    output logic [31:0] m_axil_wdata,
    output logic [ 3:0] m_axil_wstrb,
    output logic        m_axil_wvalid,
    input  logic        m_axil_wready,
    input  logic [ 1:0] m_axil_bresp,
    input  logic        m_axil_bvalid,
    output logic        m_axil_bready,
    output logic [15:0] m_axil_araddr,
    output logic        m_axil_arvalid,
    input  logic        m_axil_arready,
    input  logic [31:0] m_axil_rdata,
    input  logic [ 1:0] m_axil_rresp,
    input  logic        m_axil_rvalid,
    output logic        m_axil_rready
);
  // The registers have 64 KB; the address decoder of the SoC looks at the other bits.
  wire unused = &{1'b0, s_axi_awaddr[31:16], s_axi_araddr[31:16]};

  typedef enum logic [2:0] {
    Idle,
    Access,
    Answer,
    Refuse,
    Refused
  } state_t;

  // Writes: Idle takes the address; Access hands address and data on; Answer returns the response.
  state_t write;
  logic [ID-1:0] write_id;
  logic [15:0] write_address;
  logic address_taken, data_taken;

  assign s_axi_awready = write == Idle;
  assign m_axil_awaddr = write_address & ~16'd3;
  assign m_axil_awvalid = write == Access && s_axi_wvalid && !address_taken;
  assign m_axil_wdata = write_address[2] ? s_axi_wdata[63:32] : s_axi_wdata[31:0];
  assign m_axil_wstrb = write_address[2] ? s_axi_wstrb[7:4] : s_axi_wstrb[3:0];
  assign m_axil_wvalid = write == Access && s_axi_wvalid && !data_taken;
  assign s_axi_wready = write == Access ? m_axil_wready && !data_taken : write == Refuse;
  assign m_axil_bready = write == Answer && s_axi_bready;
  assign s_axi_bid = write_id;
  assign s_axi_bresp = write == Answer ? m_axil_bresp : 2'b10;
  assign s_axi_bvalid = write == Answer ? m_axil_bvalid : write == Refused;

  wire address_done = address_taken || m_axil_awvalid && m_axil_awready;
  wire data_done = data_taken || m_axil_wvalid && m_axil_wready;

  always_ff @(posedge clock)
    if (reset) begin
      write <= Idle;
      {address_taken, data_taken} <= '0;
    end else
      case (write)
        Idle:
        if (s_axi_awvalid) begin
          write_id <= s_axi_awid;
          write_address <= s_axi_awaddr[15:0];
          write <= s_axi_awlen == 0 && s_axi_awsize < 3 ? Access : Refuse;
        end
        Access: begin
          {address_taken, data_taken} <= address_done && data_done ? 2'b00 : {address_done, data_done};
          if (address_done && data_done) write <= Answer;
        end
        Refuse: if (s_axi_wvalid && s_axi_wlast) write <= Refused;
        default: if (s_axi_bvalid && s_axi_bready) write <= Idle;
      endcase

  // Reads: both halves of the answer have the word.
  state_t read;
  logic [ID-1:0] read_id;
  logic [15:0] read_address;
  logic [7:0] beats;

  assign s_axi_arready = read == Idle;
  assign m_axil_araddr = read_address & ~16'd3;
  assign m_axil_arvalid = read == Access;
  assign m_axil_rready = read == Answer && s_axi_rready;
  assign s_axi_rid = read_id;
  assign s_axi_rdata = {2{m_axil_rdata}};
  assign s_axi_rresp = read == Answer ? m_axil_rresp : 2'b10;
  assign s_axi_rlast = beats == 0;
  assign s_axi_rvalid = read == Answer ? m_axil_rvalid : read == Refused;

  always_ff @(posedge clock)
    if (reset) read <= Idle;
    else
      case (read)
        Idle:
        if (s_axi_arvalid) begin
          read_id <= s_axi_arid;
          read_address <= s_axi_araddr[15:0];
          beats <= s_axi_arlen;
          read <= s_axi_arlen == 0 && s_axi_arsize < 3 ? Access : Refused;
        end
        Access: if (m_axil_arready) read <= Answer;
        default:
        if (s_axi_rvalid && s_axi_rready) begin
          beats <= beats - 1;
          if (s_axi_rlast) read <= Idle;
        end
      endcase
endmodule
