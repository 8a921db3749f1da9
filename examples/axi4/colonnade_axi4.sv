// ColonnadeAxi of `colonnade generate --axi BYTES` with the AXI4 ports of an SoC: registers as a slave with 64 bits, as a
// processor's MMIO port is, and memory as a master with all signals of AXI4. With COLONNADE_SCENE defined it has the second
// master of a design whose scene is in DRAM.
module colonnade_axi4 #(
    parameter int SLAVE_ID = 4,
    parameter int MASTER_ID = 8,
    parameter int MASTER_BYTES = 8, // of the design: --axi
    parameter int DEVICE_ID = 1     // of the design: bits of m_axi_arid of ColonnadeAxi, more than 1 for rays only
`ifdef COLONNADE_SCENE
    ,
    parameter int SCENE_ID = 2,     // of the design: 1 with one or two banks of records, 2 with four
    parameter int SCENE_BYTES = 32  // of the design: columnBvhMemory.cache.busBytes
`endif
) (
    input  logic clock,
    input  logic reset,
    output logic irq,

    input  logic [SLAVE_ID-1:0] s_axi_awid, s_axi_arid,
    input  logic [31:0]   s_axi_awaddr, s_axi_araddr,
    input  logic [7:0]    s_axi_awlen, s_axi_arlen,
    input  logic [2:0]    s_axi_awsize, s_axi_arsize,
    input  logic [1:0]    s_axi_awburst, s_axi_arburst,
    input  logic          s_axi_awvalid, s_axi_wvalid, s_axi_wlast, s_axi_bready, s_axi_arvalid, s_axi_rready,
    input  logic [63:0]   s_axi_wdata,
    input  logic [7:0]    s_axi_wstrb,
    output logic          s_axi_awready, s_axi_wready, s_axi_bvalid, s_axi_arready, s_axi_rvalid, s_axi_rlast,
    output logic [SLAVE_ID-1:0] s_axi_bid, s_axi_rid,
    output logic [1:0]    s_axi_bresp, s_axi_rresp,
    output logic [63:0]   s_axi_rdata,

    output logic [MASTER_ID-1:0] m_axi_awid, m_axi_arid,
    output logic [39:0]   m_axi_awaddr, m_axi_araddr,
    output logic [7:0]    m_axi_awlen, m_axi_arlen,
    output logic [2:0]    m_axi_awsize, m_axi_arsize, m_axi_awprot, m_axi_arprot,
    output logic [1:0]    m_axi_awburst, m_axi_arburst,
    output logic          m_axi_awlock, m_axi_arlock,
    output logic [3:0]    m_axi_awcache, m_axi_arcache, m_axi_awqos, m_axi_arqos,
    output logic          m_axi_awvalid, m_axi_wvalid, m_axi_wlast, m_axi_bready, m_axi_arvalid, m_axi_rready,
    output logic [8*MASTER_BYTES-1:0] m_axi_wdata,
    output logic [MASTER_BYTES-1:0] m_axi_wstrb,
    input  logic          m_axi_awready, m_axi_wready, m_axi_bvalid, m_axi_arready, m_axi_rvalid, m_axi_rlast,
    input  logic [MASTER_ID-1:0] m_axi_bid, m_axi_rid,
    input  logic [1:0]    m_axi_bresp, m_axi_rresp,
    input  logic [8*MASTER_BYTES-1:0] m_axi_rdata
`ifdef COLONNADE_SCENE
    ,
    output logic [MASTER_ID-1:0] m_axi_scene_arid,
    output logic [39:0]   m_axi_scene_araddr,
    output logic [7:0]    m_axi_scene_arlen,
    output logic [2:0]    m_axi_scene_arsize, m_axi_scene_arprot,
    output logic [1:0]    m_axi_scene_arburst,
    output logic          m_axi_scene_arlock,
    output logic [3:0]    m_axi_scene_arcache, m_axi_scene_arqos,
    output logic          m_axi_scene_arvalid, m_axi_scene_rready,
    input  logic          m_axi_scene_arready, m_axi_scene_rvalid, m_axi_scene_rlast,
    input  logic [MASTER_ID-1:0] m_axi_scene_rid,
    input  logic [1:0]    m_axi_scene_rresp,
    input  logic [8*SCENE_BYTES-1:0] m_axi_scene_rdata
`endif
);
  // Bursts are refused. Ids of the memory's answers are the device's.
  wire unused = &{1'b0, s_axi_awburst, s_axi_arburst, m_axi_bid, m_axi_rid};

  logic [15:0] awaddr, araddr;
  logic [31:0] wdata, rdata;
  logic [3:0] wstrb;
  logic [1:0] bresp, rresp;
  logic awvalid, awready, wvalid, wready, bvalid, bready, arvalid, arready, rvalid, rready;

  axi4_to_lite #(.ID(SLAVE_ID)) bridge (
      .m_axil_awaddr(awaddr), .m_axil_awvalid(awvalid), .m_axil_awready(awready),
      .m_axil_wdata(wdata), .m_axil_wstrb(wstrb), .m_axil_wvalid(wvalid), .m_axil_wready(wready),
      .m_axil_bresp(bresp), .m_axil_bvalid(bvalid), .m_axil_bready(bready),
      .m_axil_araddr(araddr), .m_axil_arvalid(arvalid), .m_axil_arready(arready),
      .m_axil_rdata(rdata), .m_axil_rresp(rresp), .m_axil_rvalid(rvalid), .m_axil_rready(rready),
      .*
  );

  // The memory is normal, non-cacheable, bufferable.
  logic [DEVICE_ID-1:0] awid, arid;
  assign m_axi_awid = MASTER_ID'(awid);
  assign m_axi_arid = MASTER_ID'(arid);
  assign {m_axi_awlock, m_axi_arlock} = '0;
  assign {m_axi_awcache, m_axi_arcache} = {2{4'b0011}};
  assign {m_axi_awqos, m_axi_arqos} = '0;

`ifdef COLONNADE_SCENE
  wire unused_scene = &{1'b0, m_axi_scene_rid};
  logic [SCENE_ID-1:0] scene_arid;
  assign m_axi_scene_arid = MASTER_ID'(scene_arid);
  assign m_axi_scene_arlock = '0;
  assign m_axi_scene_arcache = 4'b0011;
  assign m_axi_scene_arqos = '0;
`endif

  ColonnadeAxi colonnade (
      .s_axil_awaddr(awaddr), .s_axil_awprot(3'b010), .s_axil_awvalid(awvalid), .s_axil_awready(awready),
      .s_axil_wdata(wdata), .s_axil_wstrb(wstrb), .s_axil_wvalid(wvalid), .s_axil_wready(wready),
      .s_axil_bresp(bresp), .s_axil_bvalid(bvalid), .s_axil_bready(bready),
      .s_axil_araddr(araddr), .s_axil_arprot(3'b010), .s_axil_arvalid(arvalid), .s_axil_arready(arready),
      .s_axil_rdata(rdata), .s_axil_rresp(rresp), .s_axil_rvalid(rvalid), .s_axil_rready(rready),
      .m_axi_awid(awid), .m_axi_arid(arid), .m_axi_bid(m_axi_bid[DEVICE_ID-1:0]),
      .m_axi_rid(m_axi_rid[DEVICE_ID-1:0]),
`ifdef COLONNADE_SCENE
      .m_axi_scene_arid(scene_arid), .m_axi_scene_rid(m_axi_scene_rid[SCENE_ID-1:0]),
`endif
      .*
  );
endmodule
