"""§3.2 The transformer: pre-norm blocks of self-attention over patches, whose places are told again to every block."""

import torch
from torch import Tensor, nn
from torch.nn import functional


class Transformer(nn.Module):
    """Blocks in a row and a last norm; positions are added before every block.

    Args:
        width: of a token.
        depth: number of blocks.
        heads: of attention, a divisor of the width.
        drop_path: share of clouds that skip the last block's branches in training, rising linearly from 0 at the first.
    """

    def __init__(self, width: int, depth: int, heads: int, drop_path: float):
        super().__init__()
        rates = torch.linspace(0, drop_path, depth, device="cpu").tolist()
        self.blocks = nn.ModuleList(Block(width, heads, rate) for rate in rates)
        self.norm = nn.LayerNorm(width)

    def forward(self, tokens: Tensor, positions: Tensor) -> Tensor:
        """Tokens and positions (B, T, width) → (B, T, width); reordering the T tokens reorders the result."""
        for block in self.blocks:
            tokens = block(tokens + positions)
        return self.norm(tokens)


class Block(nn.Module):
    """x + attention(norm(x)), then x + MLP(norm(x)), the MLP four times as wide."""

    def __init__(self, width: int, heads: int, drop_path: float):
        super().__init__()
        self.heads, self.drop_path = heads, drop_path
        self.attention_norm, self.mlp_norm = nn.LayerNorm(width), nn.LayerNorm(width)
        self.to_queries_keys_values = nn.Linear(width, 3 * width, bias=False)
        self.to_width = nn.Linear(width, width)
        self.mlp = nn.Sequential(nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width))
        for layer in self.modules():
            if isinstance(layer, nn.Linear):
                nn.init.trunc_normal_(layer.weight, std=0.02)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)

    def forward(self, tokens: Tensor) -> Tensor:
        tokens = tokens + self._kept(self._attention(self.attention_norm(tokens)))
        return tokens + self._kept(self.mlp(self.mlp_norm(tokens)))

    def _attention(self, tokens: Tensor) -> Tensor:
        parts = self.to_queries_keys_values(tokens).unflatten(2, (3, self.heads, -1))  # (B, T, 3, heads, width/heads)
        queries, keys, values = parts.permute(2, 0, 3, 1, 4)
        mixed = functional.scaled_dot_product_attention(queries, keys, values)  # (B, heads, T, width/heads)
        return self.to_width(mixed.transpose(1, 2).flatten(2))

    def _kept(self, branch: Tensor) -> Tensor:
        """The branch, in training left out for a share of the clouds and scaled up for the others."""
        if not (self.training and self.drop_path):
            return branch
        kept = torch.rand(len(branch), 1, 1, device=branch.device) >= self.drop_path
        return branch * (kept / (1 - self.drop_path)).to(branch.dtype)


def position_mlp(width: int) -> nn.Sequential:
    """The embedding of a centre's place: 3 → 128 → GELU → width for the published width 384, else width/3 inside."""
    return nn.Sequential(nn.Linear(3, width // 3), nn.GELU(), nn.Linear(width // 3, width))
